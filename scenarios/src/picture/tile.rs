//! One scene's picture: a map, and a band with a caption below it.

use world::geometry::Point;

use super::canvas::{Canvas, Path};
use super::caption::Legend;
use super::frame::{Bounds, Frame};
use super::{Extent, Look, Moment, agents, caption, colours, markings, signs, surface, trails};

/// A scene's picture before it is drawn.
#[derive(Debug)]
pub struct Tile<'a> {
    moment: Moment<'a>,
    frame: Frame,
    width: u32,
    map_height: u32,
    trail: f64,
}

impl<'a> Tile<'a> {
    /// As high as the scene needs: square around the AV; a whole map between a third of its width and twice it.
    pub fn fitting(moment: Moment<'a>, look: &Look) -> Self {
        let height = match look.extent {
            Extent::Radius(_) => look.width,
            Extent::Whole => {
                let aspect = bounds(moment, up(moment, look)).aspect().clamp(1.0 / 3.0, 2.0);
                (f64::from(look.width) * aspect).round() as u32
            }
        };
        Self::sized(moment, look, height)
    }

    /// With a square map.
    pub fn square(moment: Moment<'a>, look: &Look) -> Self {
        Self::sized(moment, look, look.width)
    }

    fn sized(moment: Moment<'a>, look: &Look, map_height: u32) -> Self {
        let (width, height) = (f64::from(look.width), f64::from(map_height));
        let up = up(moment, look);
        let frame = match look.extent {
            Extent::Radius(radius) => Frame::around(moment.av_pose().position(), radius, up, width),
            Extent::Whole => Frame::fitting(bounds(moment, up), up, width, height),
        };
        Self { moment, frame, width: look.width, map_height, trail: look.trail }
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.map_height + caption::height(self.width)
    }

    /// Draws map and caption; who is who is said beside the caption, or left to `legend`.
    pub fn draw(&self, canvas: &mut Canvas, legend: Option<&mut Legend>) {
        let Self { moment, frame, width, map_height, .. } = self;
        let (scene, agents) = (moment.scene(), agents::shown(frame, *moment));
        canvas.begin_cut("map", *width, *map_height);
        canvas.fill(&Path::of_rectangle(*width, *map_height), colours::GROUND);
        surface::draw(canvas, frame, scene.map());
        markings::draw(canvas, frame, scene.map());
        trails::draw(canvas, frame, *moment, self.trail);
        agents::draw(canvas, frame, &agents);
        signs::draw_stop_signs(canvas, frame, scene.map());
        signs::draw_signals(canvas, frame, scene.signals(moment.step()));
        caption::scale_bar(canvas, frame);
        canvas.end();
        canvas.begin("caption", Point::new(0.0, f64::from(*map_height)));
        let mut own = Legend::default();
        match legend {
            Some(legend) => legend.add(&agents),
            None => own.add(&agents),
        }
        caption::draw(canvas, *width, *moment, &own);
        canvas.end();
    }
}

fn up(moment: Moment<'_>, look: &Look) -> Point {
    if look.av_up { Point::unit(moment.av_pose().heading) } else { Point::new(0.0, 1.0) }
}

/// What holds the map and the AV.
fn bounds(moment: Moment<'_>, up: Point) -> Bounds {
    let map = moment.scene().map();
    let lines = map.lanes.iter().map(|lane| &lane.centerline);
    let lines = lines.chain(map.road_lines.iter().map(|line| &line.polyline));
    let lines = lines.chain(map.road_edges.iter().map(|edge| &edge.polyline));
    let areas = map.crosswalks.iter().chain(&map.speed_bumps).chain(&map.driveways).map(|area| &area.polygon);
    let points = lines.chain(areas).flatten().map(|point| point.xy());
    Bounds::of(points.chain([moment.av_pose().position()]), up)
}
