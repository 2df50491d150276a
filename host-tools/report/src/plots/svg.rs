//! Just enough SVG: elements as text, colours, escaping.

use std::fmt::Write;

/// Colours that people with any colour vision can tell apart (Okabe and Ito), and tints of them for areas.
pub(crate) mod colour {
    pub(crate) const INK: &str = "#1a1a1a";
    pub(crate) const QUIET: &str = "#5c5c5c";
    pub(crate) const GRID: &str = "#e4e4e4";
    pub(crate) const ZERO: &str = "#b5b5b5";
    pub(crate) const FRAME: &str = "#8a8a8a";
    pub(crate) const BLUE: &str = "#0072b2";
    pub(crate) const ORANGE: &str = "#f2bc4b";
    pub(crate) const GREEN: &str = "#009e73";
    pub(crate) const VERMILLION: &str = "#d55e00";
    pub(crate) const BAND_1: &str = "#b4d8ee";
    pub(crate) const BAND_3: &str = "#e2f1f9";
    pub(crate) const LANE: &str = "#f4f4f4";
    pub(crate) const WAITING: &str = "#ececec";
    pub(crate) const NO_POSE: &str = "#f6d3bf";
}

/// Where text stands to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text is set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Type {
    pub(crate) size: f64,
    pub(crate) bold: bool,
    pub(crate) colour: &'static str,
    pub(crate) anchor: Anchor,
}

/// Elements of a drawing, in the order in which they are painted.
#[derive(Default)]
pub(crate) struct Svg(String);

impl Svg {
    pub(crate) fn text(&mut self, x: f64, y: f64, set: Type, text: &str) {
        self.placed_text(&format!("x=\"{x:.1}\" y=\"{y:.1}\""), set, text);
    }

    /// Text that reads from below to above.
    pub(crate) fn upright_text(&mut self, x: f64, y: f64, set: Type, text: &str) {
        self.placed_text(&format!("transform=\"translate({x:.1} {y:.1}) rotate(-90)\""), set, text);
    }

    fn placed_text(&mut self, place: &str, set: Type, text: &str) {
        let anchor = match set.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if set.bold { " font-weight=\"700\"" } else { "" };
        let (size, colour, text) = (set.size, set.colour, escape(text));
        self.add(format_args!(
            "<text {place} font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{colour}\"{weight}>{text}</text>"
        ));
    }

    pub(crate) fn rect(&mut self, [x, y, w, h]: [f64; 4], fill: &str) {
        self.add(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"{fill}\"/>"
        ));
    }

    /// The outline of a rectangle.
    pub(crate) fn frame(&mut self, [x, y, w, h]: [f64; 4], stroke: &str) {
        self.add(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"none\" stroke=\"{stroke}\"/>"
        ));
    }

    pub(crate) fn line(&mut self, [x1, y1, x2, y2]: [f64; 4], stroke: &str, width: f64) {
        self.add(format_args!(
            "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"{stroke}\" stroke-width=\"{width}\"/>"
        ));
    }

    pub(crate) fn dashed_line(&mut self, [x1, y1, x2, y2]: [f64; 4], stroke: &str, width: f64) {
        self.add(format_args!(
            "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"{stroke}\" stroke-width=\"{width}\" stroke-dasharray=\"10 6\"/>"
        ));
    }

    /// A line along `path`; a point that stands alone shows as a dot.
    pub(crate) fn stroke(&mut self, path: &str, stroke: &str, width: f64) {
        if !path.is_empty() {
            self.add(format_args!(
                "<path d=\"{path}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" stroke-linecap=\"round\"/>"
            ));
        }
    }

    /// The same, dashed.
    pub(crate) fn dashed_stroke(&mut self, path: &str, stroke: &str, width: f64) {
        if !path.is_empty() {
            self.add(format_args!(
                "<path d=\"{path}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" stroke-dasharray=\"9 6\"/>"
            ));
        }
    }

    pub(crate) fn fill(&mut self, path: &str, fill: &str) {
        if !path.is_empty() {
            self.add(format_args!("<path d=\"{path}\" fill=\"{fill}\"/>"));
        }
    }

    /// What follows is cut at the rectangle, until [`Svg::end_clip`].
    pub(crate) fn begin_clip(&mut self, name: &str, [x, y, w, h]: [f64; 4]) {
        self.add(format_args!(
            "<clipPath id=\"{name}\"><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\"/></clipPath><g clip-path=\"url(#{name})\">"
        ));
    }

    pub(crate) fn end_clip(&mut self) {
        self.add(format_args!("</g>"));
    }

    fn add(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = self.0.write_fmt(element);
        self.0.push('\n');
    }

    pub(crate) fn into_string(self) -> String {
        self.0
    }
}

/// Text as it may stand in an element or in an attribute of SVG and HTML. Control characters, which XML
/// forbids, go.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
