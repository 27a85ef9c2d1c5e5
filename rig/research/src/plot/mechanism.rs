//! Figs. 6 and 8: the mechanism as it can be assembled, drawn.

use std::f64::consts::TAU;

use masseter_charts::palette::{BLUE, GREEN, GREY, PURPLE, VERMILION};
use masseter_charts::{
    Area, Axis, Chart, Error, Line, LineChart, Scale, SeriesLabelPosition, TEXT, TITLE, marks, svg,
};
use masseter_controller::kinematics::Solution;
use masseter_model::geometry::{LEGS, Vec3};
use plotters::prelude::*;

use crate::study::Study;

/// From where the mechanism is seen, degrees around z and above the horizontal.
const VIEW_DEG: [f64; 2] = [-62.0, 22.0];
/// Straight pieces of a drawn circle, metres; shorter ones would show the pixels that they are rounded to.
const PIECE_M: f64 = 0.004;
/// What the plane of leg 1 is shown of, mm.
const WINDOW_MM: [[f64; 2]; 2] = [[-90.0, 90.0], [205.0, 350.0]];

/// Fig. 6: true solution and folded corner, in space and in the plane of leg 1.
pub(super) fn assemblies(study: &Study) -> Result<String, Error> {
    svg((1100, 560), |area| {
        let (left, right) = area.split_horizontally(470);
        let found = || [Some(&study.set.true_one), study.set.corner_folded()].into_iter().flatten();
        let mut space = space(&left, study, "Two assemblies of one input", TITLE)?;
        for (solution, colour) in found().zip([BLUE, VERMILION]) {
            draw_assembly(&mut space, study, solution, colour)?;
        }
        loci(study, found()).draw_on(&right)
    })
}

/// The plane of leg 1 around A₁: x and z, mm.
fn loci<'a>(study: &Study, found: impl Iterator<Item = &'a Solution>) -> LineChart {
    let (mechanism, actuators) = (&study.mechanism, &study.set.actuators);
    let [_, a2, a3] = mechanism.corners_from_angles(actuators, &study.set.true_one.theta_rad);
    let hinge = mechanism.hinge(0, actuators.slide_m[0]);
    let (middle, half) = ((a2 + a3) / 2.0, (a2 - a3).norm() / 2.0);
    let side_m = mechanism.platform_sides_m()[0];
    let circles = [
        ("Cᴬ: A₁ about A₂A₃", middle, (side_m * side_m - half * half).sqrt(), GREEN),
        ("Cᴮ: A₁ about B₁", hinge, actuators.leg_m[0], PURPLE),
    ];
    let circle = |(name, centre, radius_m, colour): (_, Vec3, f64, _)| {
        let pieces = (TAU * radius_m / PIECE_M) as usize;
        let point = |piece: usize| {
            let (sin, cos) = (piece as f64 / pieces as f64 * TAU).sin_cos();
            ((centre.x + radius_m * cos) * 1e3, (centre.z + radius_m * sin) * 1e3)
        };
        let seen = |(x, z): &(f64, f64)| {
            let [[left, right], [low, high]] = WINDOW_MM;
            (left..=right).contains(x) && (low..=high).contains(z)
        };
        Line::new(name, (0..=pieces).map(point).filter(seen).collect()).coloured(colour)
    };
    let triangle = |(solution, (name, colour)): (&Solution, (_, _))| {
        let [a1, ..] = mechanism.corners_from_angles(actuators, &solution.theta_rad);
        let ends = [a1, middle].map(|end| (end.x * 1e3, end.z * 1e3));
        Line::new(name, ends.into()).coloured(colour).marked()
    };
    let triangles = found.zip([("true solution", BLUE), ("A₁ folded over", VERMILION)]).map(triangle);
    LineChart {
        title: "Plane of leg 1".to_owned(),
        x: Axis::new("x (anterior), mm", Scale::Linear, WINDOW_MM[0]),
        y: Axis::new("z (up), mm", Scale::Linear, WINDOW_MM[1]),
        lines: circles.into_iter().map(circle).chain(triangles).collect(),
        legend: SeriesLabelPosition::UpperRight,
    }
}

/// Fig. 8: every solution of the neutral input above the base.
pub(super) fn solution_set(study: &Study) -> Result<String, Error> {
    let above = study.set.above_base();
    svg((1100, 760), |area| {
        for (panel, solution) in area.split_evenly((2, 4)).iter().zip(&above) {
            let angles = solution.theta_rad.map(|angle| format!("{:.1}°", angle.to_degrees())).join(", ");
            let (colour, name) = if solution.assembly.is_true() { (BLUE, "true: ") } else { (VERMILION, "") };
            let mut space = space(panel, study, &format!("{name}{angles}"), TEXT)?;
            draw_assembly(&mut space, study, solution, colour)?;
        }
        Ok(())
    })
}

/// A view without axes, equal scales across and up: the slides over their strokes, and the triangle of their middles.
fn space<'a, 'svg>(
    area: &'a Area<'svg>,
    study: &Study,
    title: &str,
    size: u32,
) -> Result<Chart<'a, 'svg>, Error> {
    let (width, height) = area.dim_in_pixel();
    let half_height_m = 0.172;
    let half_width_m = half_height_m * f64::from(width) / f64::from(height - 30);
    let mut space =
        ChartBuilder::on(area).margin(4).caption(title, ("sans-serif", size)).build_cartesian_2d(
            Axis::new("", Scale::Linear, [-half_width_m, half_width_m]),
            Axis::new("", Scale::Linear, [0.125 - half_height_m, 0.125 + half_height_m]),
        )?;
    let mechanism = &study.mechanism;
    line(&mut space, &[0, 1, 2, 0].map(|leg| mechanism.hinge(leg, 0.0)), GREY.stroke_width(1))?;
    for leg in 0..LEGS {
        let ends = mechanism.strokes().slide_m.map(|end_m| mechanism.hinge(leg, end_m));
        line(&mut space, &ends, BLACK.mix(0.55).stroke_width(5))?;
    }
    Ok(space)
}

fn seen(point: &Vec3) -> (f64, f64) {
    let [(sin_a, cos_a), (sin_e, cos_e)] = VIEW_DEG.map(|angle| angle.to_radians().sin_cos());
    let across = -point.x * sin_a + point.y * cos_a;
    let depth = point.x * cos_a + point.y * sin_a;
    (across, point.z * cos_e - depth * sin_e)
}

fn line(space: &mut Chart<'_, '_>, points: &[Vec3], style: ShapeStyle) -> Result<(), Error> {
    space.draw_series([PathElement::new(points.iter().map(seen).collect::<Vec<_>>(), style)])?;
    Ok(())
}

fn draw_assembly(
    space: &mut Chart<'_, '_>,
    study: &Study,
    solution: &Solution,
    colour: RGBColor,
) -> Result<(), Error> {
    let (mechanism, actuators) = (&study.mechanism, &study.set.actuators);
    let corners = mechanism.corners_from_angles(actuators, &solution.theta_rad);
    space.draw_series([Polygon::new(corners.each_ref().map(seen), colour.mix(0.35))])?;
    line(space, &[corners[0], corners[1], corners[2], corners[0]], colour.stroke_width(2))?;
    for (leg, corner) in corners.iter().enumerate() {
        let hinge = mechanism.hinge(leg, actuators.slide_m[leg]);
        line(space, &[hinge, *corner], colour.stroke_width(3))?;
        marks(space, [seen(&hinge)], 4, BLACK)?;
        marks(space, [seen(corner)], 4, colour)?;
        for (at, letter) in [(&hinge, 'B'), (corner, 'A')] {
            let (x, y) = seen(at);
            let name = format!("{letter}{}", ['₁', '₂', '₃'][leg]);
            space.draw_series([Text::new(name, (x + 0.006, y + 0.004), ("sans-serif", TEXT - 1))])?;
        }
    }
    Ok(())
}
