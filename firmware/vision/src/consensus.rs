//! What the rings of a target say about one another (thesis 3.2.5): where a lost one must be, and which found
//! one is somebody else's.

use gangway_pose::MAX_CIRCLES;

use crate::{Refusal, Ring, Search, length};

/// Centres nearer than this share of a diameter are the same ring.
const SAME: f64 = 0.25;

/// Votes that outweigh a single wrong one.
const QUORUM: usize = 3;

/// A claim on a ring stands against another one if its prediction was this many times nearer.
const CLEARLY: f64 = 2.0;

/// How far the rings of `target` lie from their predictions, px: the median of those found; else of their cut
/// pieces at `cuts`; else of all targets' rings; else zero.
pub(crate) fn shift(
    searches: &[Search],
    rings: &[Result<Ring, Refusal>],
    cuts: &[Option<[f64; 2]>],
    target: u8,
) -> [f64; 2] {
    let cut = searches.iter().zip(cuts).filter_map(|(search, cut)| {
        cut.filter(|_| search.confident && search.target == target).map(|cut| offset(search, cut))
    });
    let own = median(found(searches, rings, Some(target)), 1).or_else(|| median(cut, 1));
    own.or_else(|| median(found(searches, rings, None), 1)).unwrap_or_default()
}

/// The shift by which found rings are judged: as [`shift`], but where less than three rings could vote a
/// wrong one could be the median, so it is that of all targets, if any.
pub(crate) fn trusted_shift(
    searches: &[Search],
    rings: &[Result<Ring, Refusal>],
    target: u8,
) -> Option<[f64; 2]> {
    let of_target = median(found(searches, rings, Some(target)), QUORUM);
    of_target.or_else(|| median(found(searches, rings, None), QUORUM))
}

/// How far the found rings of a target, or of all, lie from where they were confidently predicted.
fn found(
    searches: &[Search],
    rings: &[Result<Ring, Refusal>],
    target: Option<u8>,
) -> impl Iterator<Item = [f64; 2]> {
    searches.iter().zip(rings).filter_map(move |(search, ring)| {
        let votes = search.confident && target.is_none_or(|target| target == search.target);
        ring.as_ref().ok().filter(|_| votes).map(|ring| offset(search, ring.centre.at))
    })
}

/// Refuses rings that lie further from where they should than `reach_px`, and those that two searches claim.
pub(crate) fn refuse_neighbours(searches: &[Search], rings: &mut [Result<Ring, Refusal>]) {
    let mut away = [f64::INFINITY; MAX_CIRCLES];
    // Shifts by target, worked out when its first ring comes by.
    let mut known: Option<(u8, [f64; 2])> = None;
    for (i, search) in searches.iter().enumerate() {
        let Some(Ok(ring)) = rings.get(i) else { continue };
        let shift = match known {
            Some((target, shift)) if target == search.target => shift,
            _ => trusted_shift(searches, rings, search.target).unwrap_or_default(),
        };
        known = Some((search.target, shift));
        if let Some(away) = away.get_mut(i) {
            *away = distance(search, ring, shift);
        }
    }
    for ((search, ring), away) in searches.iter().zip(rings.iter_mut()).zip(away) {
        if ring.is_ok() && away > search.reach_px {
            *ring = Err(Refusal::Neighbour);
        }
    }
    // Refused only after all pairs were compared, so that the order of the searches does not matter.
    let mut claimed = [false; MAX_CIRCLES];
    for i in 0..rings.len().min(MAX_CIRCLES) {
        let Some(Ok(one)) = rings.get(i) else { continue };
        for j in i + 1..rings.len().min(MAX_CIRCLES) {
            let Some(Ok(other)) = rings.get(j) else { continue };
            let apart = [0, 1].map(|k| (one.centre.at[k] - other.centre.at[k]).abs());
            if apart[0].max(apart[1]) < SAME * one.diameter_px {
                claimed[i] |= away[i] * CLEARLY > away[j];
                claimed[j] |= away[j] * CLEARLY > away[i];
            }
        }
    }
    for (ring, claimed) in rings.iter_mut().zip(claimed) {
        if claimed {
            *ring = Err(Refusal::Neighbour);
        }
    }
}

/// Whether a ring lies too far from where it should, by a shift that is known.
pub(crate) fn is_out_of_reach(search: &Search, ring: &Ring, shift: [f64; 2]) -> bool {
    distance(search, ring, shift) > search.reach_px
}

/// How far a ring is from its prediction moved by `shift`, px.
fn distance(search: &Search, ring: &Ring, shift: [f64; 2]) -> f64 {
    let off = offset(search, ring.centre.at);
    length(off[0] - shift[0], off[1] - shift[1])
}

fn offset(search: &Search, at: [f64; 2]) -> [f64; 2] {
    [at[0] - search.at[0], at[1] - search.at[1]]
}

/// Median of each coordinate, `None` of fewer than `quorum`.
fn median(votes: impl Iterator<Item = [f64; 2]>, quorum: usize) -> Option<[f64; 2]> {
    let mut columns = [[0.0; MAX_CIRCLES]; 2];
    let mut count = 0;
    for (vote, i) in votes.zip(0..MAX_CIRCLES) {
        columns[0][i] = vote[0];
        columns[1][i] = vote[1];
        count = i + 1;
    }
    if count < quorum {
        return None;
    }
    let middle = (count - 1) / 2;
    Some(columns.map(|mut column| {
        let column = column.get_mut(..count).unwrap_or_default();
        column.sort_unstable_by(f64::total_cmp);
        column.get(middle).copied().unwrap_or_default()
    }))
}
