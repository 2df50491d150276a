//! Several curves beside each other in panels over one axis: deviations by solver, as in thesis figures 5.5
//! to 5.27, and errors against the number of circles, as in figures 5.29 and 5.30.

use super::axis::{Axis, number};
use super::picture::{Picture, WIDTH_PX};
use super::svg::{Anchor, Svg, Type, colour};
use super::trace::{self, Point};

const LEFT: f64 = 150.0;
const RIGHT: f64 = WIDTH_PX as f64 - 40.0;
const FIRST_PANEL: f64 = 178.0;
const GAP: f64 = 50.0;
const AXIS_HEIGHT: f64 = 84.0;

const TITLE: Type = Type { size: 30.0, bold: true, colour: colour::INK, anchor: Anchor::Start };
const LABEL: Type = Type { size: 21.0, bold: true, colour: colour::INK, anchor: Anchor::Middle };
const TICK: Type = Type { size: 19.0, bold: false, colour: colour::INK, anchor: Anchor::End };
const NOTE: Type = Type { size: 19.0, bold: false, colour: colour::QUIET, anchor: Anchor::Start };

/// How a curve is drawn. The looks of a family lie over one another and all stay visible: wide below, narrow
/// above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Wide, yellow.
    Wide,
    /// Of middle width, green.
    Middle,
    /// Narrow, nearly black.
    Narrow,
    /// As `Wide`, dashed.
    WideDashed,
    /// As `Middle`, dashed.
    MiddleDashed,
    /// As `Narrow`, dashed.
    NarrowDashed,
}

impl Look {
    fn pen(self) -> (&'static str, f64, bool) {
        match self {
            Self::Wide => (colour::ORANGE, 8.0, false),
            Self::Middle => (colour::GREEN, 4.5, false),
            Self::Narrow => (colour::INK, 1.4, false),
            Self::WideDashed => (colour::ORANGE, 6.0, true),
            Self::MiddleDashed => (colour::GREEN, 3.5, true),
            Self::NarrowDashed => (colour::INK, 1.4, true),
        }
    }
}

/// One curve; what the legend calls it is [`Curves::legend`]'s.
#[derive(Clone, Debug)]
pub struct Curve {
    /// How it is drawn.
    pub look: Look,
    /// Its points from left to right; `None` breaks the curve there.
    pub points: Vec<(f64, Option<f64>)>,
}

/// One panel.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name and unit, at its side.
    pub label: String,
    /// Above it, left and right.
    pub remarks: [String; 2],
    /// Its curves, the lowest first.
    pub curves: Vec<Curve>,
    /// What requirement R(a) allows, drawn where it is in reach.
    pub limit: Option<f64>,
}

/// The values' axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// About zero, with both signs.
    Signed,
    /// Powers of ten, for values above zero.
    Logarithmic,
}

/// A named stretch of the axis across.
#[derive(Clone, Debug)]
pub struct Section {
    /// Its name, written in every panel.
    pub name: String,
    /// Where it begins and ends.
    pub from_to: [f64; 2],
}

/// The whole figure.
#[derive(Clone, Debug)]
pub struct Curves {
    /// Title.
    pub title: String,
    /// Below it.
    pub subtitle: String,
    /// Looks and their names.
    pub legend: Vec<(Look, String)>,
    /// Name and unit of the axis across.
    pub across: String,
    /// Sections, left to right; may be empty.
    pub sections: Vec<Section>,
    /// The values' axis of all panels.
    pub scale: Scale,
    /// Panels from the top.
    pub panels: Vec<Panel>,
}

/// Draws the figure.
pub fn curves(figure: &Curves) -> Picture {
    // One panel has room, six have to share it.
    let height = match figure.panels.len() {
        0 | 1 => 420.0,
        2 | 3 => 250.0,
        _ => 170.0,
    };
    let mut svg = Svg::default();
    svg.text(LEFT, 50.0, TITLE, &figure.title);
    svg.text(LEFT, 82.0, NOTE, &figure.subtitle);
    let across = across(figure);
    for (index, panel) in figure.panels.iter().enumerate() {
        let top = FIRST_PANEL + index as f64 * (height + GAP);
        draw_panel(&mut svg, figure, panel, index, &across, [LEFT, top, RIGHT - LEFT, height]);
    }
    let has_limit = figure.panels.iter().any(|panel| limit_in_reach(figure.scale, panel).is_some());
    legend(&mut svg, figure, has_limit);
    let bottom = FIRST_PANEL + figure.panels.len() as f64 * (height + GAP) - GAP;
    for (value, label) in across.ticks(10.0) {
        let x = across.px(value);
        svg.line([x, bottom, x, bottom + 8.0], colour::FRAME, 1.0);
        svg.text(x, bottom + 30.0, Type { anchor: Anchor::Middle, ..TICK }, &label);
    }
    svg.text((LEFT + RIGHT) / 2.0, bottom + 60.0, LABEL, &figure.across);
    Picture::new(&svg.into_string(), (bottom + AXIS_HEIGHT).ceil() as u32)
}

fn across(figure: &Curves) -> Axis {
    let points = figure.panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|(x, _)| *x);
    let ends = figure.sections.iter().flat_map(|section| section.from_to);
    let [low, high] =
        points.chain(ends).fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
    Axis::new(if low <= high { [low, high] } else { [0.0, 1.0] }, [LEFT, RIGHT])
}

fn legend(svg: &mut Svg, figure: &Curves, has_limit: bool) {
    let y = 116.0;
    let mut x = LEFT;
    let mut entry = |svg: &mut Svg, (colour, width, dashed): (&str, f64, bool), text: &str| {
        if dashed {
            svg.dashed_line([x, y, x + 44.0, y], colour, width);
        } else {
            svg.line([x, y, x + 44.0, y], colour, width);
        }
        svg.text(x + 54.0, y + 6.5, Type { colour: colour::INK, ..NOTE }, text);
        // The font's mean width is about half its size.
        x += 54.0 + text.chars().count() as f64 * NOTE.size * 0.5 + 34.0;
    };
    for (look, name) in &figure.legend {
        entry(svg, look.pen(), name);
    }
    if has_limit {
        entry(svg, (colour::VERMILLION, 2.0, true), "limit R(a)");
    }
}

fn values(panel: &Panel) -> impl Iterator<Item = f64> {
    panel.curves.iter().flat_map(|c| &c.points).filter_map(|(_, y)| *y).filter(|y| y.is_finite())
}

/// The value as the axis takes it; nothing for what a logarithmic axis cannot show.
fn scaled(scale: Scale, value: f64) -> Option<f64> {
    match scale {
        Scale::Signed => Some(value).filter(|v| v.is_finite()),
        Scale::Logarithmic => (value > 0.0 && value.is_finite()).then(|| value.log10()),
    }
}

/// Range of the values' axis, as the axis takes it.
fn range(scale: Scale, panel: &Panel) -> [f64; 2] {
    let scaled = values(panel).filter_map(|v| scaled(scale, v));
    let [low, high] = scaled.fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)]);
    if low > high {
        return [-1.0, 1.0];
    }
    match scale {
        Scale::Signed => {
            // Zero is always there, and both signs are: a deviation is judged by its distance from it.
            let most = 1.1 * low.abs().max(high.abs()).max(1e-9);
            [-most, most]
        }
        Scale::Logarithmic => [low - 0.1, high + 0.25],
    }
}

fn limit_in_reach(scale: Scale, panel: &Panel) -> Option<f64> {
    let limit = panel.limit?;
    let [_, high] = range(scale, panel);
    scaled(scale, limit).filter(|limit| *limit <= high).map(|_| limit)
}

fn ticks(scale: Scale, axis: &Axis) -> Vec<(f64, String)> {
    match scale {
        Scale::Signed => axis.ticks(4.0),
        Scale::Logarithmic => {
            let steps: &[f64] = if axis.high - axis.low > 2.2 { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let mut all = Vec::new();
            for power in axis.low.floor() as i32..=axis.high.ceil() as i32 {
                for step in steps {
                    let at = f64::from(power) + step.log10();
                    if at >= axis.low && at <= axis.high {
                        let digits = usize::try_from(-power).unwrap_or(0);
                        all.push((at, number(step * 10f64.powi(power), digits)));
                    }
                }
            }
            all
        }
    }
}

fn draw_panel(svg: &mut Svg, figure: &Curves, panel: &Panel, index: usize, across: &Axis, area: [f64; 4]) {
    let [x, y, w, h] = area;
    let value = Axis::new(range(figure.scale, panel), [y + h, y]);
    let ticks = ticks(figure.scale, &value);
    for (at, label) in &ticks {
        svg.text(x - 10.0, value.px(*at) + 6.5, TICK, label);
    }
    svg.upright_text(42.0, y + h / 2.0, LABEL, &panel.label);
    let [left, right] = &panel.remarks;
    svg.text(x, y - 9.0, NOTE, left);
    svg.text(x + w, y - 9.0, Type { anchor: Anchor::End, ..NOTE }, right);
    svg.begin_clip(&format!("panel{index}"), area);
    for (at, _) in across.ticks(10.0) {
        let at = across.px(at);
        svg.line([at, y, at, y + h], colour::GRID, 1.0);
    }
    for (at, _) in &ticks {
        let shade = if *at == 0.0 && figure.scale == Scale::Signed { colour::ZERO } else { colour::GRID };
        let at = value.px(*at);
        svg.line([x, at, x + w, at], shade, 1.0);
    }
    for section in &figure.sections {
        let [from, to] = section.from_to.map(|at| across.px(at));
        svg.line([to, y, to, y + h], colour::FRAME, 1.0);
        let middle = Type { anchor: Anchor::Middle, colour: colour::QUIET, ..NOTE };
        svg.text((from + to) / 2.0, y + 22.0, middle, &section.name);
    }
    if let Some(limit) = limit_in_reach(figure.scale, panel) {
        let both = if figure.scale == Scale::Signed { [limit, -limit] } else { [limit, limit] };
        for at in both.iter().filter_map(|limit| scaled(figure.scale, *limit)) {
            svg.dashed_line([x, value.px(at), x + w, value.px(at)], colour::VERMILLION, 2.0);
        }
    }
    for curve in &panel.curves {
        let mut points = Vec::new();
        let mut joined = false;
        for (at, v) in &curve.points {
            let v = v.and_then(|v| scaled(figure.scale, v));
            if let Some(v) = v {
                points.push(Point { x: across.px(*at), y: value.px(v), joined });
            }
            joined = v.is_some();
        }
        let path = trace::line(&trace::reduce(&points, w));
        let (colour, width, dashed) = curve.look.pen();
        if dashed {
            svg.dashed_stroke(&path, colour, width);
        } else {
            svg.stroke(&path, colour, width);
        }
    }
    svg.end_clip();
    svg.frame(area, colour::FRAME);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(scale: Scale, values: &[Option<f64>]) -> Curves {
        let points = values.iter().enumerate().map(|(i, v)| (i as f64, *v)).collect();
        Curves {
            title: "Deviation".to_owned(),
            subtitle: "made up".to_owned(),
            legend: vec![(Look::Narrow, "auto".to_owned())],
            across: "frame".to_owned(),
            sections: Vec::new(),
            scale,
            panels: vec![Panel {
                label: "x / mm".to_owned(),
                remarks: [const { String::new() }; 2],
                curves: vec![Curve { look: Look::Narrow, points }],
                limit: Some(10.0),
            }],
        }
    }

    #[test]
    fn a_missing_value_breaks_the_curve() {
        let whole = curves(&figure(Scale::Signed, &[Some(1.0), Some(2.0), Some(-1.0), Some(0.0)]));
        let broken = curves(&figure(Scale::Signed, &[Some(1.0), Some(2.0), None, Some(0.0)]));
        let starts = |picture: &Picture| picture.svg().matches("stroke-linejoin").count();
        assert_eq!((starts(&whole), starts(&broken)), (1, 1));
        let path = |picture: &Picture| {
            let text = picture.svg().to_owned();
            let end = text.find("\" fill=\"none\" stroke=\"#1a1a1a\"").unwrap();
            text[text[..end].rfind("d=\"").unwrap()..end].matches('M').count()
        };
        assert_eq!((path(&whole), path(&broken)), (1, 2));
    }

    #[test]
    fn the_limit_is_drawn_only_where_it_is_in_reach() {
        let shown =
            |scale, most| curves(&figure(scale, &[Some(0.5), Some(most)])).svg().contains("limit R(a)");
        assert!(!shown(Scale::Signed, 2.0) && shown(Scale::Signed, 12.0));
        assert!(!shown(Scale::Logarithmic, 2.0) && shown(Scale::Logarithmic, 12.0));
    }

    #[test]
    fn a_logarithmic_axis_leaves_out_what_it_cannot_show_and_still_draws() {
        let picture = curves(&figure(Scale::Logarithmic, &[Some(0.0), None, Some(-3.0), Some(f64::NAN)]));
        picture.png().unwrap();
        let empty = curves(&Curves { panels: Vec::new(), ..figure(Scale::Signed, &[]) });
        empty.png().unwrap();
    }
}
