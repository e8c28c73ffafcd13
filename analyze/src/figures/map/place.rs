//! Where the points of a map stand in an area, and which of them lie so far out that they stand at its edge.

use super::super::coloring::bulk;
use crate::picture::Point;

/// Room around all points, of the shorter side of the area.
const MARGIN: f64 = 0.04;
/// Room behind an end beyond which points lie outside, of the extent.
const BEYOND: f64 = 0.05;
/// From the middle of a triangle to its tip, points.
const TIP: f64 = 1.8;

/// The part of the plane that is shown: all points, or all but a few that would leave the others little room, as the first steps of episodes do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Window {
    x: (f64, f64),
    y: (f64, f64),
}

impl Window {
    /// The window of these points.
    pub(in super::super) fn of(points: &[[f64; 2]]) -> Self {
        let axis = |d: usize| {
            let ((lo, hi), cut) = bulk(points.iter().map(|p| p[d])).unwrap_or(((0.0, 1.0), (false, false)));
            let beyond = |is_cut: bool| if is_cut { BEYOND * (hi - lo) } else { 0.0 };
            (lo - beyond(cut.0), hi + beyond(cut.1))
        };
        Self { x: axis(0), y: axis(1) }
    }

    /// Height over width, kept between half and 1.
    pub(in super::super) fn aspect(&self) -> f64 {
        ((self.y.1 - self.y.0) / (self.x.1 - self.x.0).max(f64::MIN_POSITIVE)).clamp(0.5, 1.0)
    }

    /// Points placed in an area of `w × h` with a margin, both axes to the same scale and y upwards.
    pub(in super::super) fn place(&self, points: &[[f64; 2]], (w, h): (f64, f64)) -> Placed {
        let margin = 2.0 * MARGIN * w.min(h);
        let scale = |(lo, hi): (f64, f64), room: f64| (room - margin) / (hi - lo).max(f64::MIN_POSITIVE);
        let scale = scale(self.x, w).min(scale(self.y, h)).min(f64::MAX);
        let middle = |(lo, hi): (f64, f64)| (lo + hi) / 2.0;
        let at = |p: &[f64; 2]| (w / 2.0 + (p[0] - middle(self.x)) * scale, h / 2.0 - (p[1] - middle(self.y)) * scale);
        Placed { centers: points.iter().map(at).collect(), size: (w, h) }
    }
}

/// Points in an area, from its upper left corner.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Placed {
    centers: Vec<Point>,
    size: (f64, f64),
}

impl Placed {
    /// How many points there are.
    pub(in super::super) fn count(&self) -> usize {
        self.centers.len()
    }

    /// Where a point stands; none of one outside, which is a triangle.
    pub(in super::super) fn center(&self, point: usize) -> Option<Point> {
        let (x, y) = self.centers[point];
        let is_inside = (0.0..=self.size.0).contains(&x) && (0.0..=self.size.1).contains(&y);
        is_inside.then_some((x, y))
    }

    /// How many of some points lie outside.
    pub(in super::super) fn outside(&self, points: impl Iterator<Item = usize>) -> usize {
        points.filter(|&point| self.center(point).is_none()).count()
    }

    /// The triangle that a point outside is: at the edge where it is nearest, its tip outwards; in a picture in which the area begins at a place.
    pub(in super::super) fn triangle(&self, point: usize, origin: Point) -> [Point; 3] {
        let ((x, y), (w, h)) = (self.centers[point], self.size);
        // A place that is no number stands in the corner.
        let (x, y) = (x.max(TIP).min(w - TIP), y.max(TIP).min(h - TIP));
        let sides = [(x, (-1.0, 0.0)), (w - x, (1.0, 0.0)), (y, (0.0, -1.0)), (h - y, (0.0, 1.0))];
        let nearest = sides.into_iter().min_by(|a, b| f64::total_cmp(&a.0, &b.0));
        let (right, down) = nearest.map_or((0.0, -1.0), |(_, out)| out);
        let corner = |out: f64, aside: f64| {
            let (across, along) = (out * right - aside * down, out * down + aside * right);
            (origin.0 + x + TIP * across, origin.1 + y + TIP * along)
        };
        [corner(1.0, 0.0), corner(-0.7, 0.9), corner(-0.7, -0.9)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of points, and some far away from it.
    fn points(far: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let square = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20)]);
        square.chain(far.iter().copied()).collect()
    }

    #[test]
    fn a_few_points_far_away_leave_the_others_their_room() {
        let all = points(&[[300.0, 5.0], [5.0, -2000.0]]);
        let window = Window::of(&all);
        assert!(window.aspect() > 0.9, "as of the square: {}", window.aspect());
        let placed = window.place(&all, (100.0, 100.0));
        assert_eq!((placed.count(), placed.outside(0..402), placed.outside(0..400)), (402, 2, 0));
        let xs: Vec<f64> = (0..400).filter_map(|point| placed.center(point)).map(|(x, _)| x).collect();
        let (least, most) = (xs.iter().copied().fold(100.0, f64::min), xs.iter().copied().fold(0.0, f64::max));
        assert!(most - least > 80.0, "{least} to {most} of 100");
    }

    #[test]
    fn a_triangle_stands_at_the_edge_and_points_outwards() {
        let all = points(&[[300.0, 5.0], [5.0, -2000.0]]);
        let placed = Window::of(&all).place(&all, (100.0, 80.0));
        let [right, low] = [400, 401].map(|point| placed.triangle(point, (10.0, 20.0)));
        assert!((right[0].0 - 110.0).abs() < 1e-9 && right[1].0 < 108.0, "{right:?}");
        assert!((low[0].1 - 100.0).abs() < 1e-9 && low[1].1 < 98.0, "{low:?}");
    }

    #[test]
    fn without_points_far_away_all_are_shown() {
        for extent in [1e-12, 1.0, 1e12] {
            let all: Vec<[f64; 2]> = points(&[[22.0, 10.0]]).iter().map(|p| p.map(|x| x * extent)).collect();
            let placed = Window::of(&all).place(&all, (100.0, 100.0));
            assert_eq!(placed.outside(0..all.len()), 0);
            let (left, right) = (placed.center(0).expect("inside"), placed.center(400).expect("inside"));
            assert!(right.0 - left.0 > 85.0, "{left:?} {right:?}");
        }
        let same = vec![[3.0, 3.0]; 50];
        let placed = Window::of(&same).place(&same, (100.0, 60.0));
        assert_eq!((placed.center(7), Window::of(&[]).aspect()), (Some((50.0, 30.0)), 1.0));
    }
}
