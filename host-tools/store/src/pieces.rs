//! Puts the setup's text together from its numbered pieces.

use gangway_wire::SetupPiece;
use sha2::{Digest, Sha256};

use crate::meta::hex;

/// Most pieces that are believed: 16 KiB of text in pieces of one byte.
const MAX_PIECES: u16 = 16_384;

/// The pieces of the setup that was announced last, and the last whole text.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    digest: [u8; 16],
    parts: Vec<Option<String>>,
    whole: Option<String>,
    refused: Option<String>,
}

impl Pieces {
    /// Takes a piece; pieces of another setup begin anew.
    pub(crate) fn add(&mut self, piece: &SetupPiece<'_>) {
        if piece.count == 0 || piece.count > MAX_PIECES || piece.index >= piece.count {
            return;
        }
        if piece.digest != self.digest || self.parts.len() != usize::from(piece.count) {
            self.digest = piece.digest;
            self.parts = vec![None; piece.count.into()];
            self.whole = None;
        }
        if self.whole.is_some() {
            return;
        }
        self.parts[usize::from(piece.index)] = Some(piece.text.to_owned());
        if self.parts.iter().all(Option::is_some) {
            let text: String = self.parts.iter().flatten().map(String::as_str).collect();
            let digest = Sha256::digest(text.as_bytes());
            if digest[..16] == piece.digest {
                self.whole = Some(text);
            } else {
                self.refused = Some(format!(
                    "the setup in it has digest {} where {} was announced",
                    hex(&digest[..16]),
                    hex(&piece.digest)
                ));
            }
        }
    }

    /// The whole text, or what is missing.
    pub(crate) fn text(self) -> Result<String, String> {
        let (have, of) = (self.parts.iter().flatten().count(), self.parts.len());
        match (self.whole, self.refused) {
            (Some(text), _) => Ok(text),
            (None, Some(why)) => Err(why),
            (None, None) if of == 0 => Err("holds no setup".to_owned()),
            (None, None) => Err(format!("holds only {have} of {of} pieces of the setup")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(text: &str) -> [u8; 16] {
        Sha256::digest(text.as_bytes())[..16].try_into().unwrap()
    }

    fn add(pieces: &mut Pieces, text: &'static str, digest: [u8; 16], order: &[u16]) {
        let halves = text.split_at(text.len() / 2);
        for &index in order {
            let text = if index == 0 { halves.0 } else { halves.1 };
            pieces.add(&SetupPiece { digest, index, count: 2, text });
        }
    }

    #[test]
    fn pieces_in_any_order_and_repeated_make_the_text() {
        let mut pieces = Pieces::default();
        add(&mut pieces, "name = \"ride\"\n", digest("name = \"ride\"\n"), &[1, 1, 0, 1, 0]);
        assert_eq!(pieces.text().unwrap(), "name = \"ride\"\n");
    }

    #[test]
    fn pieces_of_two_setups_are_never_mixed() {
        let mut pieces = Pieces::default();
        add(&mut pieces, "old text", digest("old text"), &[0, 1]);
        add(&mut pieces, "new text", digest("new text"), &[0]);
        assert_eq!(pieces.text().unwrap_err(), "holds only 1 of 2 pieces of the setup");
        assert_eq!(Pieces::default().text().unwrap_err(), "holds no setup");
    }

    #[test]
    fn a_text_that_is_not_the_announced_one_is_refused() {
        let mut pieces = Pieces::default();
        add(&mut pieces, "other", digest("text"), &[0, 1]);
        assert!(pieces.text().unwrap_err().contains("where"));
    }
}
