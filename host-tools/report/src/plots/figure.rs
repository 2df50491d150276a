//! The frame of a figure: title, legend, six panels over one time axis, where there is no pose, and the
//! flags.

use std::fmt::Write;

use gangway_wire::PoseFlags;

use super::axis::Axis;
use super::picture::{Picture, WIDTH_PX};
use super::svg::{Anchor, Svg, Type, colour};
use super::trace::{self, Point};
use crate::evaluation::frame_interval_s;
use crate::table::short;
use crate::{DEGREES_OF_FREEDOM, Evaluation, Row};

const LEFT: f64 = 150.0;
const RIGHT: f64 = WIDTH_PX as f64 - 40.0;
const FIRST_PANEL: f64 = 172.0;
const PANEL_HEIGHT: f64 = 150.0;
const PANEL_PITCH: f64 = 194.0;
const PANELS_END: f64 = FIRST_PANEL + 5.0 * PANEL_PITCH + PANEL_HEIGHT;
const LANE_HEIGHT: f64 = 26.0;
const TIME_AXIS_HEIGHT: f64 = 84.0;

const TITLE: Type = Type { size: 30.0, bold: true, colour: colour::INK, anchor: Anchor::Start };
const LABEL: Type = Type { size: 21.0, bold: true, colour: colour::INK, anchor: Anchor::Middle };
const TICK: Type = Type { size: 19.0, bold: false, colour: colour::INK, anchor: Anchor::End };
const NOTE: Type = Type { size: 19.0, bold: false, colour: colour::QUIET, anchor: Anchor::Start };

/// Lines end where two frames are further apart than so many frame intervals.
const GAP_INTERVALS: f64 = 1.5;

/// Narrowest mark of a span, px: one frame in hours is still seen.
const NARROWEST_PX: f64 = 2.0;

/// One entry of the legend.
pub(crate) enum Key {
    Line(&'static str, f64),
    Dashed(&'static str),
    Area(&'static str),
}

/// A figure under construction.
pub(crate) struct Figure<'a> {
    svg: Svg,
    rows: &'a [Row],
    time: Axis,
    interval_s: f64,
}

/// One of its panels.
pub(crate) struct Panel {
    index: usize,
    pub(crate) value: Axis,
}

impl Panel {
    fn area(index: usize) -> [f64; 4] {
        [LEFT, FIRST_PANEL + PANEL_PITCH * index as f64, RIGHT - LEFT, PANEL_HEIGHT]
    }
}

impl<'a> Figure<'a> {
    /// Title and legend, and where there is no pose, in all panels.
    pub(crate) fn new(title: &str, evaluation: &'a Evaluation, mut legend: Vec<(Key, &str)>) -> Self {
        let rows = &evaluation.rows;
        let times = rows.iter().map(|r| r.time_s);
        let range = times.fold([f64::MAX, f64::MIN], |[low, high], t| [low.min(t), high.max(t)]);
        let interval_s = frame_interval_s(rows).unwrap_or(0.0);
        let mut figure =
            Self { svg: Svg::default(), rows, time: Axis::new(range, [LEFT, RIGHT]), interval_s };

        let subtitle = match &evaluation.reference {
            Some(reference) => format!("{}, against {}", short(&evaluation.session), short(reference)),
            None => short(&evaluation.session).to_owned(),
        };
        let frames = &evaluation.frames;
        let subtitle = format!("{subtitle}: {} of {} frames", frames.compared, frames.all);
        figure.svg.text(LEFT, 50.0, TITLE, title);
        figure.svg.text(LEFT, 82.0, NOTE, &subtitle);
        let (waiting, missing) = (figure.waiting(), figure.missing());
        if !waiting.is_empty() {
            legend.push((Key::Area(colour::WAITING), "waiting for the rest pose"));
        }
        if !missing.is_empty() {
            legend.push((Key::Area(colour::NO_POSE), "no pose"));
        }
        figure.legend(&legend);
        let areas: Vec<[f64; 4]> = (0..6).map(Panel::area).collect();
        for (spans, fill) in [(waiting, colour::WAITING), (missing, colour::NO_POSE)] {
            for area in &areas {
                figure.svg.fill(&bars(&spans, area[1], area[3]), fill);
            }
        }
        figure
    }

    fn legend(&mut self, entries: &[(Key, &str)]) {
        let y = 116.0;
        let mut x = LEFT;
        for (key, text) in entries {
            match key {
                Key::Line(colour, width) => self.svg.line([x, y, x + 44.0, y], colour, *width),
                Key::Dashed(colour) => self.svg.dashed_line([x, y, x + 44.0, y], colour, 2.0),
                Key::Area(colour) => {
                    self.svg.rect([x, y - 10.0, 44.0, 20.0], colour);
                    self.svg.frame([x, y - 10.0, 44.0, 20.0], colour::GRID);
                }
            }
            self.svg.text(x + 54.0, y + 6.5, Type { colour: colour::INK, ..NOTE }, text);
            // The font's mean width is a little under half its size.
            x += 54.0 + text.chars().count() as f64 * NOTE.size * 0.46 + 40.0;
        }
    }

    /// Opens a panel: value axis, its name at the side and two remarks above it. What is drawn until
    /// [`Figure::end_panel`] is cut at its edges.
    pub(crate) fn begin_panel(&mut self, index: usize, range: [f64; 2], remarks: [(&str, bool); 2]) -> Panel {
        let area = Panel::area(index);
        let [x, y, w, h] = area;
        let panel = Panel { index, value: Axis::new(range, [y + h, y]) };
        for (value, label) in panel.value.ticks(4.0) {
            let at = panel.value.px(value);
            self.svg.text(x - 10.0, at + 6.5, TICK, &label);
        }
        let of = DEGREES_OF_FREEDOM[index];
        self.svg.upright_text(42.0, y + h / 2.0, LABEL, &format!("{} / {}", of.name, of.unit_sign));
        for ((text, warn), (at, anchor)) in
            remarks.into_iter().zip([(x, Anchor::Start), (x + w, Anchor::End)])
        {
            let colour = if warn { colour::VERMILLION } else { colour::QUIET };
            self.svg.text(at, y - 9.0, Type { anchor, colour, bold: warn, ..NOTE }, text);
        }
        self.svg.begin_clip(&format!("panel{index}"), area);
        panel
    }

    /// Draws the grid, over areas and under lines.
    pub(crate) fn grid(&mut self, panel: &Panel) {
        let [x, y, w, h] = Panel::area(panel.index);
        for (t, _) in self.time.ticks(10.0) {
            let at = self.time.px(t);
            self.svg.line([at, y, at, y + h], colour::GRID, 1.0);
        }
        for (value, _) in panel.value.ticks(4.0) {
            let at = panel.value.px(value);
            let shade = if value == 0.0 { colour::ZERO } else { colour::GRID };
            self.svg.line([x, at, x + w, at], shade, 1.0);
        }
    }

    /// Closes a panel.
    pub(crate) fn end_panel(&mut self, panel: &Panel) {
        self.svg.end_clip();
        self.svg.frame(Panel::area(panel.index), colour::FRAME);
    }

    /// A line through what `value` gives of each frame, broken where it gives nothing and where frames are
    /// missing.
    pub(crate) fn line(
        &mut self,
        panel: &Panel,
        colour: &str,
        width: f64,
        value: impl Fn(&Row) -> Option<f64>,
    ) {
        let path = trace::line(&self.points(panel, value));
        self.svg.stroke(&path, colour, width);
    }

    /// The area from minus to plus what `half_width` gives of each frame.
    pub(crate) fn band(&mut self, panel: &Panel, colour: &str, half_width: impl Fn(&Row) -> Option<f64>) {
        let path = trace::band(&self.points(panel, half_width), panel.value.px(0.0));
        self.svg.fill(&path, colour);
    }

    /// A dashed line across.
    pub(crate) fn limit(&mut self, panel: &Panel, value: f64) {
        let y = panel.value.px(value);
        self.svg.dashed_line([LEFT, y, RIGHT, y], colour::VERMILLION, 2.0);
    }

    fn points(&self, panel: &Panel, value: impl Fn(&Row) -> Option<f64>) -> Vec<Point> {
        let mut points = Vec::new();
        let mut before = f64::NEG_INFINITY;
        for row in self.rows {
            if let Some(value) = value(row).filter(|v| v.is_finite()) {
                let since = row.time_s - before;
                let joined = since > 0.0 && since <= GAP_INTERVALS * self.interval_s;
                points.push(Point { x: self.time.px(row.time_s), y: panel.value.px(value), joined });
                before = row.time_s;
            }
        }
        trace::reduce(&points, RIGHT - LEFT)
    }

    /// Where frames waited for the rest pose.
    fn waiting(&self) -> Vec<[f64; 2]> {
        self.spans(self.rows.iter().filter(|r| r.is_waiting()).map(|r| self.around(r)))
    }

    /// Where frames gave no pose, or there are no frames.
    fn missing(&self) -> Vec<[f64; 2]> {
        let mut before: Option<&Row> = None;
        let mut missing = Vec::new();
        for row in self.rows {
            let half = self.interval_s / 2.0;
            if let Some(before) = before
                && row.time_s - before.time_s > GAP_INTERVALS * self.interval_s
            {
                missing.push([before.time_s + half, row.time_s - half]);
            }
            if row.measured.is_none() && !row.is_waiting() {
                missing.push(self.around(row));
            }
            before = Some(row);
        }
        self.spans(missing.into_iter())
    }

    fn around(&self, row: &Row) -> [f64; 2] {
        [row.time_s - self.interval_s / 2.0, row.time_s + self.interval_s / 2.0]
    }

    /// Intervals of time as intervals of pixels, those that touch made one: no more of them than columns.
    fn spans(&self, times: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
        let mut spans: Vec<[f64; 2]> = Vec::new();
        for [from, to] in times {
            let (from, to) = (self.time.px(from), self.time.px(to));
            let widen = (NARROWEST_PX - (to - from)).max(0.0) / 2.0;
            let (from, to) = ((from - widen).max(LEFT), (to + widen).min(RIGHT));
            match spans.last_mut() {
                Some(last) if from <= last[1] + 0.1 && to >= last[0] => last[1] = last[1].max(to),
                _ => spans.push([from, to]),
            }
        }
        spans
    }

    /// A lane for each flag that poses carry, the time axis, and the picture is done.
    pub(crate) fn finish(mut self) -> Picture {
        let flagged = |flag| {
            let rows = self.rows.iter().filter(move |r| r.measured.is_some() && r.flags.contains(flag));
            self.spans(rows.map(|r| self.around(r)))
        };
        // "no pose" once more: behind the lines of hours, one frame cannot be seen.
        let lanes = [
            (self.missing(), "no pose"),
            (flagged(PoseFlags::AMBIGUOUS), "ambiguous"),
            (flagged(PoseFlags::OUTLIERS), "outliers"),
            (flagged(PoseFlags::BEYOND_LIMITS), "beyond limits"),
            (flagged(PoseFlags::AFTER_GAP), "after gap"),
            (flagged(PoseFlags::CORRUPT), "damaged"),
            (flagged(PoseFlags::CAMERA_MOVED), "camera moved"),
            (flagged(PoseFlags::UNREFERENCED), "unreferenced"),
        ];
        let mut y = PANELS_END + 8.0;
        for (spans, name) in lanes.iter().filter(|(spans, _)| !spans.is_empty()) {
            self.svg.rect([LEFT, y + 4.0, RIGHT - LEFT, LANE_HEIGHT - 8.0], colour::LANE);
            self.svg.fill(&bars(spans, y + 4.0, LANE_HEIGHT - 8.0), colour::VERMILLION);
            self.svg.text(LEFT - 10.0, y + 19.0, TICK, name);
            y += LANE_HEIGHT;
        }
        for (t, label) in self.time.ticks(10.0) {
            let x = self.time.px(t);
            self.svg.line([x, y, x, y + 8.0], colour::FRAME, 1.0);
            self.svg.text(x, y + 30.0, Type { anchor: Anchor::Middle, ..TICK }, &label);
        }
        self.svg.text((LEFT + RIGHT) / 2.0, y + 60.0, LABEL, "time since the first frame / s");
        Picture::new(&self.svg.into_string(), (y + TIME_AXIS_HEIGHT).ceil() as u32)
    }
}

/// One path of rectangles, all of one height.
fn bars(spans: &[[f64; 2]], y: f64, height: f64) -> String {
    let mut path = String::new();
    for [from, to] in spans {
        let _ = write!(path, "M{from:.1} {y:.1}H{to:.1}v{height:.1}H{from:.1}z");
    }
    path
}
