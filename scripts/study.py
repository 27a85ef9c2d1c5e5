"""Judges the paper's claims by the tables of a study, and draws its figures: python scripts/study.py FOLDER [--samples N …]

FOLDER is what `masseter-research study --out FOLDER` writes; if it is not there, this command makes it, with the options that follow.
study.html and the figures go there. The same tables give the same bytes.
"""
import json
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

from study_claims import (
    ANYWHERE, CAPS, CONTROLLER, JAW_ANYWHERE, NEWTON, NEWTONS, PUBLISHED, READINGS, RESIDUALS, STEPS, STROKES, Share, Trials, folded, judged)

matplotlib.use("svg")
matplotlib.rcParams.update({
    "svg.fonttype": "none", "svg.hashsalt": "masseter", "font.family": "sans-serif", "font.size": 9,
    "axes.grid": True, "grid.color": "#e4e4e4", "axes.axisbelow": True,
})
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.colors import ListedColormap  # noqa: E402

FOLDER = Path(sys.argv[1])
# What the page of a run is made of.
PAGE = Path(__file__).parents[1] / "rig/show/page"
STUDY = ["cargo", "run", "--quiet", "--release", "-p", "masseter-research", "--", "study", "--out", FOLDER]
# Okabe and Ito's colours.
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, GREY = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999")
# The solvers that are compared, by their names in tables: the name shown, and the colour in every figure.
SOLVERS = {PUBLISHED: ("published: reduced full steps", BLUE), READINGS[1]: ("published: bounded increments", ORANGE),
           NEWTON: ("Newton–Raphson", VERMILION), CONTROLLER: ("controller", GREEN)}
# The ways to step, with their colours.
WAYS = [*zip(STEPS, (BLUE, ORANGE, PURPLE)), ("Newton–Raphson", VERMILION)]
CLASSES = [BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION]
MOTIONS = ["#ffffff", "#ffb000", "#ff5f8f", "#9fffff", "#c090ff", "#ff3030", "#70e070", "#ff90ff"]
AXES = ["d1", "d2", "d3", "l1", "l2", "l3"]
COORDINATES = {"x_mm": "x (anterior), mm", "y_mm": "y (left), mm", "z_mm": "z (up), mm", "roll_deg": "roll (about x), °",
               "pitch_deg": "pitch (about y), °", "yaw_deg": "yaw (about z), °"}
# Names of the tables of disagreements, and what they show.
DISAGREEMENTS = {"fig3_diverging": "Fig. 3: Newton–Raphson diverges", "fig4_oscillating": "Fig. 4: Newton–Raphson oscillates",
                 "fig3b_stalling": "Beside Fig. 3: the paper's solver stalls"}
# Figures of the workspace: their maps, the column of their tables, what it is, and captions.
CONDITIONING = ("condition", "condition number", "conditioning (condition number of the 6×6 Jacobian, turns taken at the platform's side)")
WORKSPACES = {
    "workspace_translation": (["x_z", "y_z"], "Where the platform can go", *CONDITIONING),
    "workspace_orientation": (["roll_pitch", "yaw_pitch"], "How the platform can turn", *CONDITIONING),
    "workspace_singularity": (["x_z", "y_z"], "Where the platform can go", "regular_within_deg", "regular within, °",
                              "distance to a singularity (change of the leg angles within which the Jacobian is proven regular)"),
    "workspace_separation": (["x_z", "y_z"], "Where the platform can go", "separation_deg", "next solution, °",
                             "distance to the next other solution of the same input (largest difference of any leg's angle)"),
}
# Iterations shown, of a whole course and of its last cycles.
ITERATIONS, LAST = 40, 20
# Errors below this are zero but for rounding, cm².
LEAST_CM2 = 1e-30
# Guesses anywhere above the base: each leg is within 90° of the vertical.
ABOVE_BASE_DEG = 90
# Smaller forces count as zero, N.
NONE_N = 0.05


def table(name: str) -> pd.DataFrame:
    return pd.read_csv(FOLDER / f"{name}.csv")


def panels(width: int, height: int, rows: int, columns: int, **more):
    """Axes in a figure of so many pixels."""
    figure, axes = plt.subplots(rows, columns, figsize=(width / 100, height / 100), layout="constrained", squeeze=False, **more)
    return figure, list(axes.flat)


def save(figure, name: str) -> None:
    figure.savefig(FOLDER / f"{name}.svg", dpi=100, metadata={"Date": None})
    plt.close(figure)


def of_solver(data: pd.DataFrame):
    """Rows of each solver that is compared, with its name and colour."""
    for solver, (name, colour) in SOLVERS.items():
        yield name, colour, data[data.solver == solver]


def speed() -> None:
    figure, (iterations, times) = panels(1100, 460, 1, 2)
    trials = Trials(table("success")).solved(PUBLISHED, ANYWHERE).of
    for name, colour, rows in of_solver(table("iterations")):
        solved = rows.set_index("iterations").trials.reindex(range(ITERATIONS + 1), fill_value=0).cumsum()
        iterations.plot(solved.index, 100 * solved / trials, label=name, color=colour)
    iterations.set(title="Solved within so many iterations", xlabel="iterations", ylabel="share of guesses solved, %",
                   xlim=(0, ITERATIONS), ylim=(0, 102))
    iterations.legend(loc="lower right")
    measured = table("speed")
    starts = list(measured.start.unique())
    timed = [(colour, rows) for _, colour, rows in of_solver(measured) if len(rows)]
    for place, (colour, rows) in enumerate(timed):
        at = [starts.index(start) + 0.29 * (place - 1) for start in rows.start]
        # The length of a bar says nothing on a logarithmic axis.
        times.plot(at, rows.median_ns, "o", markersize=8, color=colour)
        for x, ns, ratio in zip(at, rows.median_ns, rows.ratio_of_medians_to_newton):
            times.annotate(f"{ns:.0f} ns\n×{ratio:.2f}", (x, ns), (0, 8), textcoords="offset points", ha="center")
    times.set(title="Time of a solution", ylabel="median, ns", yscale="log")
    times.set_ylim(0.5 * measured.median_ns.min(), 4 * measured.median_ns.max())
    times.set_xticks(range(len(starts)), starts)
    times.margins(x=0.15)
    save(figure, "fig5_speed")


def seen(points) -> tuple:
    """Where points in space appear to somebody who looks from 62° beside and 22° above."""
    (x, y, z), (beside, above) = np.asarray(points, float).T, np.radians((-62, 22))
    depth = x * np.cos(beside) + y * np.sin(beside)
    return -x * np.sin(beside) + y * np.cos(beside), z * np.cos(above) - depth * np.sin(above)


def hinges(slide: str):
    slides = table("mechanism")
    return slides[slides.slide == slide].sort_values("leg")[["x_m", "y_m", "z_m"]].to_numpy()


def corners(solution: pd.Series):
    return [[solution[f"a{leg}_{axis}_m"] for axis in "xyz"] for leg in (1, 2, 3)]


def space(axes, title: str, assemblies: list) -> None:
    """The mechanism with some of its assemblies, each with its colour."""
    axes.set(title=title, aspect="equal")
    axes.axis("off")
    middle = hinges("neutral")
    axes.plot(*seen([*middle, middle[0]]), color=GREY, linewidth=1)
    for ends in zip(hinges("low"), hinges("high")):
        axes.plot(*seen(ends), color="#737373", linewidth=4)
    for solution, colour in assemblies:
        triangle = corners(solution)
        axes.fill(*seen(triangle), color=colour, alpha=0.35)
        axes.plot(*seen([*triangle, triangle[0]]), color=colour, linewidth=2)
        for leg, (hinge, corner) in enumerate(zip(middle, triangle)):
            axes.plot(*seen([hinge, corner]), color=colour, linewidth=2.5)
            for point, letter, dot in ((hinge, "B", "black"), (corner, "A", colour)):
                (x,), (y,) = seen([point])
                axes.plot(x, y, "o", color=dot, markersize=5)
                axes.annotate(f"{letter}{'₁₂₃'[leg]}", (x, y), (4, 4), textcoords="offset points")


def solutions_above_base() -> pd.DataFrame:
    """The true one first, then by their angles in order of size."""
    found = table("fig8_solutions")
    found = found[found.above_base == 1]
    order = sorted(found.index, key=lambda row: (
        -found.true[row], sorted(round(found[f"theta{leg}_deg"][row], 6) for leg in (1, 2, 3))))
    return found.loc[order]


def assemblies() -> None:
    truth, second = folded(table("fig8_solutions"))
    shown = [(truth, BLUE, "true solution"), *((row, VERMILION, "A₁ folded over") for _, row in second.iterrows())]
    figure, (left, right) = panels(1100, 560, 1, 2, width_ratios=(3, 4))
    space(left, "Two assemblies of one input", [(solution, colour) for solution, colour, _ in shown])
    a1, a2, a3 = np.array(corners(truth))
    middle, hinge = (a2 + a3) / 2, hinges("neutral")[0]
    turn = np.linspace(0, 2 * np.pi, 721)
    for name, centre, colour in (("Cᴬ: A₁ about A₂A₃", middle, GREEN), ("Cᴮ: A₁ about B₁", hinge, PURPLE)):
        radius = np.linalg.norm(a1 - centre)
        right.plot(1e3 * (centre[0] + radius * np.cos(turn)), 1e3 * (centre[2] + radius * np.sin(turn)), color=colour, label=name)
    for solution, colour, name in shown:
        ends = 1e3 * np.array([corners(solution)[0], middle])
        right.plot(ends[:, 0], ends[:, 2], "o-", color=colour, label=name)
    right.set(title="Plane of leg 1", xlabel="x (anterior), mm", ylabel="z (up), mm", xlim=(-90, 90), ylim=(205, 350))
    right.legend(loc="upper right")
    save(figure, "fig6_assemblies")


def solution_set() -> None:
    figure, axes = panels(1100, 760, 2, 4)
    for panel, (_, solution) in zip(axes, solutions_above_base().iterrows()):
        angles = ", ".join(f"{solution[f'theta{leg}_deg']:.1f}°" for leg in (1, 2, 3))
        is_true = solution.true == 1
        space(panel, ("true: " if is_true else "") + angles, [(solution, BLUE if is_true else VERMILION)])
    save(figure, "fig8_solutions")


def multiplicity() -> None:
    figure, (axes,) = panels(760, 420, 1, 1)
    counts = table("multiplicity")
    counts = counts[(counts.counted == "all") & (counts.solutions % 2 == 0) & (counts.inputs > 0)]
    shares = 100 * counts.inputs / counts.inputs.sum()
    bars = axes.bar(counts.solutions, shares, 1.4, color=BLUE)
    axes.bar_label(bars, [f"{solutions}: {share:.1f} %" for solutions, share in zip(counts.solutions, shares)])
    axes.set(title="Solutions of random inputs", xlabel="real solutions (mirrored ones counted)", ylabel="share of inputs, %",
             xlim=(-1, 17), ylim=(0, 1.15 * max(10, shares.max())))
    save(figure, "multiplicity")


def basins() -> None:
    cells = table("basins")
    last = ["a leg below the base", "no solution reached"]
    size = lambda name: [float(part) for part in name.strip("true solution()").replace("°", "").split(",")]
    classes = sorted(set(cells.reaches) - set(last), key=lambda name: (not name.startswith("true"), size(name)))
    names = classes + last
    colours = [CLASSES[place % len(CLASSES)] for place in range(len(classes))] + [GREY, "#000000"]
    figure, axes = panels(1140, 1240, 3, 3)
    for panel, solver in zip(axes, [*READINGS, *NEWTONS, CONTROLLER]):
        reaches = cells[cells.solver == solver].reaches
        side = round(len(reaches) ** 0.5)
        # A grid of vectors leaves pale seams between the cells; a picture has none.
        panel.imshow(reaches.map(names.index).to_numpy().reshape(side, side), origin="lower", extent=(0, 180, 0, 180),
                     cmap=ListedColormap(colours), vmin=-0.5, vmax=len(names) - 0.5, interpolation="nearest")
        panel.set(title=f"{solver}: true {100 * reaches.str.startswith('true').mean():.0f} %", xlabel="θ₁ of the guess, °",
                  ylabel="θ₂ of the guess, °")
        panel.grid(False)
    figure.legend([plt.Rectangle((0, 0), 1, 1, color=colour) for colour in colours], names, loc="outside lower center", ncols=3)
    save(figure, "basins")


def readings() -> None:
    """Three rates of every reading over the iterations allowed, beside Newton–Raphson's with the same residual."""
    trials = Trials(table("success"))
    rates = [("reaches any solution\n(first advantage)", trials.solved, "share of guesses, %"),
             ("reaches the true solution", trials.true_ones, "share of guesses, %"),
             ("what it reaches is the closest\n(third advantage)", trials.closest, "share of solutions reached, %")]
    figure, axes = panels(1140, 760, 2, 3, sharex=True, sharey=True)
    for panel, (residual, (title, rate, label)) in zip(axes, ((residual, rate) for residual in RESIDUALS for rate in rates)):
        for way, colour in WAYS:
            shares = [100 * rate(f"{way}, {residual}", ANYWHERE, cap).value for cap in CAPS]
            is_rival = way == "Newton–Raphson"
            panel.plot(range(len(CAPS)), shares, "s--" if is_rival else "o-", color=colour, label=way if is_rival else f"Fig. 2 with {way}")
        panel.set(ylabel=f"{residual}:\n{label}" if rate == trials.solved else label, ylim=(-3, 103))
        panel.set_title(title if residual == RESIDUALS[0] else "")
        panel.set_xticks(range(len(CAPS)), CAPS)
    for panel in axes[3:]:
        panel.set(xlabel="iterations allowed")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside upper center", ncols=len(WAYS))
    save(figure, "readings")


def success() -> None:
    figure, (any_one, true_one) = panels(1100, 440, 1, 2)
    rates = table("success")
    for name, colour, rows in of_solver(rates[(rates.inputs == STROKES) & (rates.most_iterations == CAPS[-1])]):
        at = [ABOVE_BASE_DEG if guesses == "above base" else float(guesses.strip("±°")) for guesses in rows.guesses]
        for axes, hits in ((any_one, rows.reached_true + rows.reached_other), (true_one, rows.reached_true)):
            axes.plot(at, 100 * hits / rows.trials, "o-", label=name, color=colour)
    for axes, title in ((any_one, "Any solution"), (true_one, "The true solution")):
        axes.set(title=title, xlabel="guesses within ±, °", ylabel="share of guesses, %", xlim=(0, 95), ylim=(0, 102))
        axes.legend(loc="lower left")
    save(figure, "success")


def traces(name: str, title: str, oscillates: bool) -> None:
    """The error over the iterations; beside an oscillation its last cycles."""
    rows = table(name)
    has_cycles = oscillates and len(rows) > 0
    figure, axes = panels(1140 if has_cycles else 760, 440, 1, 2 if has_cycles else 1, **({"width_ratios": (3, 2)} if has_cycles else {}))
    for solver, label, colour in ((PUBLISHED, "paper's solver", BLUE), (NEWTON, "Newton–Raphson", VERMILION)):
        course = rows[(rows.solver == solver) & (rows.iteration <= ITERATIONS)]
        axes[0].plot(course.iteration, course.error_cm2.clip(lower=LEAST_CM2), "o-", markersize=3, label=label, color=colour)
    axes[0].set(title=title, xlabel="iteration", ylabel="error f₁² + f₂² + f₃², cm²", yscale="log", xlim=(0, ITERATIONS))
    axes[0].legend(loc="center right")
    if has_cycles:
        cycles = rows[rows.solver == NEWTON].tail(LAST)
        axes[1].plot(cycles.iteration, cycles.error_cm2, "o-", markersize=3, color=VERMILION)
        axes[1].set(title="Newton–Raphson: last cycles", xlabel="iteration")
    save(figure, name)


def workspace(name: str, maps: list, column: str, label: str) -> None:
    """Maps of the workspace with the jaw's motions inside."""
    tables = [table(f"workspace_{one}") for one in maps]
    values = pd.concat(tables)[column].dropna()
    # The highest values would leave the others without contrast. From zero on, so that equal colours are nearly equal values.
    low, high = (min(0, values.min()), values.quantile(0.9)) if len(values) else (0, 1)
    paths = table("motion_paths")
    figure, axes = panels(1140, 554, 1, 2)
    for panel, cells in zip(axes, tables):
        across, up = cells.columns[:2]
        grid = cells.pivot(index=up, columns=across, values=column)
        step = [(axis[-1] - axis[0]) / (len(axis) - 1) / 2 for axis in (grid.columns, grid.index)]
        extent = (grid.columns[0] - step[0], grid.columns[-1] + step[0], grid.index[0] - step[1], grid.index[-1] + step[1])
        image = panel.imshow(grid, origin="lower", extent=extent, vmin=low, vmax=high, aspect="auto", interpolation="none")
        # The last first: a wide opening covers no smaller one on the same path.
        for motion, colour in reversed(list(zip(paths.motion.unique(), MOTIONS))):
            path = paths[paths.motion == motion]
            # A dark rim keeps the path visible on every colour of the map.
            panel.plot(path[across], path[up], color="black", linewidth=4)
            panel.plot(path[across], path[up], color=colour, linewidth=2, label=motion)
        panel.grid(False)
        panel.set(xlabel=COORDINATES[across], ylabel=COORDINATES[up], xlim=extent[:2], ylim=extent[2:])
    figure.colorbar(image, ax=axes, label=f"{label} (yellow: {high:.3g} and more)")
    handles, motions = panel.get_legend_handles_labels()
    figure.legend(handles[::-1], motions[::-1], loc="outside upper center", ncols=len(MOTIONS) // 2, facecolor="#cccccc")
    save(figure, name)


def forces() -> None:
    rows = table("forces")
    figure, axes = panels(1140, 640, 2, 3, sharex=True, sharey="row")
    for panel, axis in zip(axes, AXES):
        for friction, colour in zip(rows.friction.unique(), (BLUE, VERMILION, GREEN)):
            curve = rows[(rows.friction == friction) & (rows.axis == axis)]
            panel.plot(curve.time_s, curve.force_n, color=colour, label=friction)
        panel.set(title=f"{'slide' if axis[0] == 'd' else 'leg'} {axis}", xlabel="time in the cycle, s", ylabel="force, N")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    save(figure, "forces")


def bites() -> None:
    rows = table("bites")
    looks = {"desired": {"color": GREY, "linewidth": 6, "alpha": 0.5}, "estimated": {"color": VERMILION}, "true": {"color": BLUE}}
    figure, axes = panels(1140, 380, 1, 3)
    for panel, food in zip(axes, rows.food.unique()):
        for force, look in looks.items():
            curve = rows[(rows.food == food) & (rows.force == force)]
            panel.plot(curve.time_s, curve.force_n, label=force, **look)
        panel.set(title=food, xlabel="time since the contact, s", ylabel="bite force, N", xlim=(-0.1, 0.6), ylim=(-3, 85))
        panel.legend(loc="upper right")
    save(figure, "bites")


def pressure() -> None:
    """The mean pressure on each tooth: on the arch when all bear most, and over time."""
    teeth = table("pressure")
    figure, (axes, times) = panels(1140, 480, 1, 2, width_ratios=(1, 1))
    middle = [(teeth[axis].min() + teeth[axis].max()) / 2 for axis in ("right_mm", "forward_mm")]
    most_mm2 = max(1e-9, teeth.area_mm2.max())
    colours = plt.cm.ScalarMappable(plt.Normalize(0, max(1e-9, teeth.mean_mpa.max())))
    for tooth in teeth.itertuples():
        is_loaded = tooth.force_n >= NONE_N
        radius = max(4, 18 * (tooth.area_mm2 / most_mm2) ** 0.5)
        axes.plot(tooth.right_mm, tooth.forward_mm, "o", markersize=1.44 * radius, markeredgecolor="#555555",
                  color=colours.to_rgba(tooth.mean_mpa) if is_loaded else "none")
        away = tooth.right_mm - middle[0], tooth.forward_mm - middle[1]
        scale = 0.72 * (radius + 6) / max(1e-9, (away[0] ** 2 + away[1] ** 2) ** 0.5)
        name = f"{tooth.tooth}: {tooth.mean_mpa:.0f} MPa" if is_loaded else f"{tooth.tooth}"
        axes.annotate(name, (tooth.right_mm, tooth.forward_mm), (scale * away[0], scale * away[1]), textcoords="offset points",
                      ha="right" if away[0] < 0 else "left", va="center")
    axes.set(xlabel="left  ←  mm  →  right", ylabel="forward, mm", aspect="equal")
    axes.margins(0.42, 0.2)
    figure.colorbar(colours, ax=axes, label="mean pressure, MPa", location="bottom", shrink=0.7)
    courses = table("pressures")
    courses = courses[courses.run == "pressed teeth"]
    left = sorted(tooth for tooth in courses.tooth.unique() if tooth < 40)
    for place, tooth in enumerate(left):
        course = courses[courses.tooth == tooth]
        times.plot(course.time_s, course.mean_mpa, color=plt.cm.plasma(place / max(1, len(left))), label=str(tooth))
    times.set(title="Left teeth over time", xlabel="time, s", ylabel="mean pressure, MPa")
    times.legend(title="tooth", loc="upper right")
    save(figure, "pressure")


def reach() -> list[list]:
    """Rows of the lowest and the highest value of each axis of a map at which the mechanism can be."""
    rows = []
    for name in ("x_z", "y_z", "roll_pitch", "yaw_pitch"):
        cells = table(f"workspace_{name}")
        reached = cells[cells.determinant.notna()]
        for axis in cells.columns[:2]:
            ends = [f"{reached[axis].min():.1f}", f"{reached[axis].max():.1f}"] if len(reached) else ["–", "–"]
            rows.append([{"text": f"workspace_{name}", "href": f"workspace_{name}.csv"}, COORDINATES[axis], *ends])
    return rows


def rates(origin: tuple) -> list[list]:
    """Any, true and closest of those reached, in %, with every cap, of every solver; iterations, and the basin of the true one."""
    trials = Trials(table("success"))
    cells = table("basins")
    rows = []
    for solver in [*READINGS, *NEWTONS, CONTROLLER]:
        values = [[rate(solver, origin, cap) for rate in (trials.solved, trials.true_ones, trials.closest)] for cap in CAPS]
        shown = [" / ".join(f"{100 * share.value:.1f}" if share.of else "–" for share in shares) for shares in values]
        row = trials.rows[origin, solver, CAPS[-1]]
        basin = cells[cells.solver == solver].reaches.str.startswith("true").mean()
        rows.append([solver, *shown, f"{row.iterations_median:g} ({row.iterations_p90:g})", f"{100 * basin:.0f} %"])
    return rows


RATES = [*map(str, CAPS), "iterations, median (90 %)", "basin of the true one"]


def warm(steps_ms) -> list[list]:
    """Lost steps of all, and iterations of a step, mean and most, of every solver by the time of a step."""
    motions = table("motions")
    rows = []
    for solver in [*READINGS, *NEWTONS, CONTROLLER]:
        of = lambda step: motions[(motions.solver == solver) & (motions.step_ms == step)]
        cell = lambda one: (f"{one.steps_lost.sum()} of {one.steps.sum()}; "
                            f"{(one.iterations_mean * one.steps).sum() / one.steps.sum():.1f} ({one.iterations_max.max()})")
        rows.append([solver, *(cell(of(step)) for step in steps_ms)])
    return rows


def captions() -> dict:
    """Of each figure, in the order of the page."""
    shares = table("disagreements").set_index("disagreement")
    found = {}
    for name, title in DISAGREEMENTS.items():
        rows = table(name)
        found[name] = f"{title}: no guess of this run does so."
        if len(rows):
            of = lambda names, scale=1: ", ".join(f"{rows[column][0] * scale:.1f}" for column in names)
            share = Share(shares.trials[name], shares.of[name])
            found[name] = (
                f"{title}. d = ({of(['d1_m', 'd2_m', 'd3_m'], 1e3)}) mm, l = ({of(['l1_m', 'l2_m', 'l3_m'], 1e3)}) mm, guess θ = "
                f"({of(['guess1_deg', 'guess2_deg', 'guess3_deg'])})°; {share} of guesses above the base do so.")
    found |= {
        "fig5_speed": "Fig. 5. Left: share of guesses above the base that have led to any solution after so many iterations (of the "
        "controller those of its last start; a cold start eliminates first). Right: median time of a solution, with the ratio to "
        "Newton–Raphson's; from random guesses only where all three reach a solution.",
        "fig6_assemblies": "Fig. 6. Two assemblies of the neutral input (d = 0, all legs equal). Left: the true one and the one with "
        "corner A₁ folded over. Right: in the plane of leg 1 the circle on which the triangle carries A₁ about A₂A₃ (Cᴬ) and that of "
        "the leg about B₁ (Cᴮ) meet twice.",
        "fig8_solutions": f"Fig. 8. The {len(solutions_above_base())} solutions of the neutral input above the base (leg angles over "
        "each); as many mirrored ones lie below it. The true solution is the first.",
        "multiplicity": "Number of real solutions of random inputs over the whole strokes; an input without any cannot be assembled.",
        "readings": "Random inputs over the whole strokes, guesses anywhere above the base. Each reading of Fig. 2 stands beside "
        "Newton–Raphson with the same residual (rows) and as many iterations (abscissa). A time step of 0.1 needs some 300 iterations to "
        "the tolerance of 10⁻²⁴ cm². A share of the solutions reached is shown where any is reached.",
        "basins": "Basins of convergence of the neutral input: which solution (leg angles in order of size) each guess leads to. The "
        "guess's θ₃ is that of the true solution.",
        "success": "Success of random guesses over their greatest distance from the true leg angles (every leg within ± this; the points "
        "at 90° are guesses anywhere above the base). Left: any solution reached. Right: the true one.",
    }
    for name, (_, what, _, _, measure) in WORKSPACES.items():
        found[name] = (f"{what} within the strokes, with {measure}. White: out of reach. The other coordinates are those of the neutral "
                       "pose; the jaw's motions are projections, which leave the slice in the other coordinates.")
    pressed = table("pressed").iloc[0]
    return found | {
        "forces": "Forces of the six drives in one chewing cycle at 1.43 Hz, with encoders without noise. Friction under load is that of "
        "guides, screws and joints; seals and viscous friction come on top. Each drive of a leg carries a third of the weight.",
        "bites": "The second controlled bite on each food: the desired force is half a sine from the force of contact on. The jaw meets "
        "gum and peanut at the speed of the motion, so that the force rises above that of contact at first. After the bite the jaw waits "
        "until the motion opens.",
        "pressure": f"Left: the arch from above at {pressed.time_s:.3f} s, when all teeth together bear most: {pressed.teeth_n:.1f} N. The "
        "area of a disc is in proportion to the area of contact, its colour is the mean pressure. Right: the teeth of the left side over "
        "the bites. Each pair meets in one cusp (Hertz), whose radius is an assumption; the highest pressure is 1.5 times the mean.",
    }


def table_block(name: str, label: str, texts: list[str], numbers: list[str], rows: list[list]) -> dict:
    columns = [{"title": title, "is_number": title in numbers} for title in [*texts, *numbers]]
    return {"id": name, "kind": "table", "data": {"label": label, "columns": columns, "rows": rows}}


def sections(claims: list) -> list[dict]:
    settings = table("settings").iloc[0]
    steps_ms = table("motions").step_ms.unique()
    text = lambda name, words: {"id": name, "kind": "text", "data": words}
    tone = {"holds": "good", "holds in part": "doubtful", "does not hold": "bad"}
    figure = lambda claim: {"text": "figure", "href": f"#{claim.figure}.svg"} if claim.figure else ""
    rows = [[str(number), f"{claim.statement} — {claim.section}", {"mark": claim.verdict, "tone": tone[claim.verdict]}, claim.measured,
             claim.criterion, figure(claim)] for number, claim in enumerate(claims, 1)]
    return [
        {"id": "claims", "title": "Claims", "blocks": [
            text("about", "The paper describes the 6-DOF mastication mechanism and its forward kinematics. Fig. 2 leaves three things open, "
                 "and every reading is measured: the increment that is reduced (Newton's full step; Newton's step bounded to 0.2 rad; a time "
                 "step of 0.1 of the continuous method θ̇ = −J⁻¹f), the residual (distances as in eq. 1, or squared), and the number of "
                 "iterations. As printed is the full step with distances. Where no number is given, 1000 iterations are allowed; an increment "
                 f"is halved at most 40 times. From above the base: {settings.samples} random inputs with one true solution, each with a random "
                 "guess of leg angles between 0° and 180°. Verdicts follow from the figures of this run by the criterion beside them."),
            text("again", f"To repeat it: `{settings.command}`. Only times differ from run to run."),
            table_block("claims", "Table of claims", ["#", "the paper's claim", "verdict", "measured", "criterion", "figure"], [], rows)]},
        {"id": "readings", "title": "Readings", "blocks": [
            text("rates-about", "Any / true / closest solution of those reached, in %. Random inputs over the whole strokes, guesses above the "
                 "base; columns are the iterations allowed."),
            table_block("rates", "Table of rates", ["solver"], RATES, rates(ANYWHERE)),
            text("jaw-about", "The same with inputs of jaw motions."),
            table_block("jaw-rates", "Table of rates with jaw motions", ["solver"], RATES, rates(JAW_ANYWHERE)),
            text("warm-about", "Along the jaw motions, each step from the solution before: steps lost; iterations, mean (most)."),
            table_block("warm", "Table of warm starts", ["solver"], [f"{step} ms" for step in steps_ms], warm(steps_ms))]},
        {"id": "workspace", "title": "Workspace", "blocks": [
            text("reach-about", "Reach within the strokes, the other coordinates as at the neutral pose. Not measured: what the paper says "
                 "of the Stewart platform and genetic algorithms."),
            table_block("reach", "Table of the reach", ["map", "coordinate"], ["from", "to"], reach())]},
        {"id": "figures", "title": "Figures", "blocks": [
            block for name, caption in captions().items()
            for block in ({"id": f"{name}.svg", "kind": "figure", "data": (FOLDER / f"{name}.svg").read_text()}, text(f"about-{name}", caption))]},
    ]


def page(claims: list) -> str:
    """The page of a run's report with this content."""
    settings = table("settings").iloc[0]
    data = {"title": "The paper's claims beside what was measured", "life": "finished", "moments": [], "phases": [],
            "about": f"Masseter {settings.version}, random numbers from seed {settings.seed}",
            "time": {"motion_s": None, "end_s": 0, "period_s": 0.001, "wall_s": None}, "sections": sections(claims)}
    scripts = re.findall(r'include_str!\("\.\./assets/(\w+\.js)"\)', (PAGE / "src/page.rs").read_text())
    asset = lambda name: (PAGE / "assets" / name).read_text()
    parts = {"title": data["title"], "style|safe": asset("style.css"), "script|safe": "".join(map(asset, scripts)),
             # No text can end the element that holds the data.
             "data|safe": json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")}
    template = (PAGE / "templates/page.html").read_text()
    return re.sub(r"\{\{ ([\w|]+) \}\}", lambda part: parts[part[1]], template)


if not FOLDER.exists():
    subprocess.run([*STUDY, *sys.argv[2:]], check=True, stdout=subprocess.DEVNULL)
claims = judged(FOLDER)
for claim in claims:
    print(f"{claim.verdict:<13}  {claim.statement}")
speed()
assemblies()
solution_set()
multiplicity()
basins()
readings()
success()
for name, title in DISAGREEMENTS.items():
    traces(name, title, name == "fig4_oscillating")
for name, (maps, _, column, label, _) in WORKSPACES.items():
    workspace(name, maps, column, label)
forces()
bites()
pressure()
# The page holds the figures.
(FOLDER / "study.html").write_text(page(claims))
