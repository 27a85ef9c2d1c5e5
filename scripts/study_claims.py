"""The paper's claims, judged by the tables of a study. The criteria are defined here alone; each is a function of measured values,
so that other values give another judgement. scripts/study.py writes them into study.html.
"""
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import pandas as pd

STROKES, JAW = "whole strokes", "jaw motions"
# Origins: inputs and guesses.
ANYWHERE, CLOSE, JAW_ANYWHERE, JAW_CLOSE = (STROKES, "above base"), (STROKES, "±5°"), (JAW, "above base"), (JAW, "±5°")
STEPS, RESIDUALS = ("reduced full steps", "bounded increments", "time steps"), ("distances", "squared distances")
# The readings of Fig. 2: what is reduced, and of which residual. The first is the one as printed.
READINGS = [f"{step}, {residual}" for residual in RESIDUALS for step in STEPS]
NEWTONS = [f"Newton–Raphson, {residual}" for residual in RESIDUALS]
PUBLISHED, NEWTON, CONTROLLER = READINGS[0], NEWTONS[0], "controller"
# Iterations allowed; the last is no bound in practice.
CAPS = (10, 20, 50, 100, 1000)
ORIENTED = "conditions 1 and 2, plane oriented"
# A rule that fails in a smaller share of cases nearly holds.
RARELY = 0.01
# The time the paper states for one computation, ns.
STATED_NS = 0.1
# Share of a real-time cycle of 1 ms for one solution, ns: a tenth.
REAL_TIME_NS = 1e5
# How many times more iterations are "much more".
MUCH_MORE = 2
HOLDS, IN_PART, NOT = "holds", "holds in part", "does not hold"
# Share of the force without friction above which friction matters.
MATTERS = 0.1
# Largest difference between the forces of the teeth and the bite force, as a share.
BALANCED = 0.05
# Before the end of a bite the force is held, s.
HELD_S = 0.2
# Force to which the bite of the pressed jaws is controlled, N.
COMMANDED_N = 60
# Leg angles closer than this are one, degrees.
SAME_DEG = 1e-4


@dataclass(frozen=True)
class Share:
    """So many of so many."""
    hits: int
    of: int

    @property
    def value(self) -> float:
        return self.hits / self.of if self.of else float("nan")

    @property
    def is_all(self) -> bool:
        return 0 < self.of == self.hits

    def clearly_exceeds(self, other: "Share") -> bool:
        """By three standard errors of the difference: another sample would hardly contradict."""
        variance = sum(share.value * (1 - share.value) / share.of for share in (self, other) if share.of)
        difference = self.value - other.value
        return difference > 0 and difference >= 3 * sqrt(variance)

    def __str__(self) -> str:
        """In per cent; with more digits where rounding would give 0 or 100 %."""
        text = f"{100 * self.value:.1f}"
        pretends = (text == "100.0" and not self.is_all) or (text == "0.0" and self.hits > 0)
        return f"{100 * self.value:.3f} %" if pretends else f"{text} %"


@dataclass(frozen=True)
class Claim:
    statement: str
    section: str
    # The measurements that decide.
    measured: str
    # When it holds, and when it holds in part.
    criterion: str
    verdict: str
    figure: str | None


def verdict(holds: bool, partly: bool) -> str:
    return HOLDS if holds else IN_PART if partly else NOT


def over_readings(verdicts: dict) -> str:
    """A claim that holds under some readings alone holds in part."""
    found = set(verdicts.values())
    return verdict(found == {HOLDS}, found != {NOT})


def words(verdicts: dict) -> str:
    """Under which readings a claim holds, and in part, with the caps where not all do."""
    said = []
    for wanted in (HOLDS, IN_PART):
        under = {}
        for (reading, cap), found in verdicts.items():
            if found == wanted:
                under.setdefault(reading, []).append(cap)
        names = (reading if len(caps) == len(CAPS) else f"{reading} (at most {', '.join(map(str, caps))} iterations)"
                 for reading, caps in under.items())
        said += [f"{wanted} under: {'; '.join(names)}"] if under else []
    return ". ".join(said) or "under no reading"


def is_predictable(closest: Share) -> bool:
    """One criterion for two claims: 99 % of the solutions reached are the closest ones."""
    return closest.of > 0 and closest.value >= 1 - RARELY


def reaches_the_closest(published: Share, newton: Share) -> str:
    return verdict(is_predictable(published), published.clearly_exceeds(newton))


def cannot_be_predicted(close: Share, jaw: Share) -> str:
    return verdict(not is_predictable(jaw), not is_predictable(close))


def wider(solved: list[Share], true_ones: list[Share]) -> str:
    """Each of the published solver and of Newton–Raphson."""
    return verdict(solved[0].clearly_exceeds(solved[1]), true_ones[0].clearly_exceeds(true_ones[1]))


def unique(several: Share) -> str:
    return verdict(several.of > 0 and several.hits == 0, several.value < RARELY)


def faster(medians: list[float], p90s: list[float]) -> str:
    """Each of the published solver and of Newton–Raphson."""
    return verdict(medians[1] >= MUCH_MORE * medians[0], medians[1] > medians[0] or p90s[1] >= MUCH_MORE * p90s[0])


class Trials:
    """The table of success rates and costs. Without a cap, the highest counts."""

    def __init__(self, success: pd.DataFrame):
        self.rows = {((row.inputs, row.guesses), row.solver, row.most_iterations): row for row in success.itertuples()}

    def solved(self, solver: str, origin: tuple, cap: int = CAPS[-1]) -> Share:
        row = self.rows[origin, solver, cap]
        return Share(row.reached_true + row.reached_other, row.trials)

    def true_ones(self, solver: str, origin: tuple, cap: int = CAPS[-1]) -> Share:
        row = self.rows[origin, solver, cap]
        return Share(row.reached_true, row.trials)

    def closest(self, solver: str, origin: tuple, cap: int = CAPS[-1]) -> Share:
        return Share(self.rows[origin, solver, cap].reached_closest, self.solved(solver, origin, cap).hits)

    def by_reading(self, judge) -> dict:
        """The verdict of every reading with every cap, beside Newton–Raphson with the same residual and cap."""
        rivals = {reading: NEWTONS[place // len(STEPS)] for place, reading in enumerate(READINGS)}
        return {(reading, cap): judge((reading, rivals[reading]), cap) for reading in READINGS for cap in CAPS}


def several(multiplicity: pd.DataFrame, counted: str, more_than: int) -> Share:
    """Of the inputs with any solution that counts: how many have more than so many."""
    rows = multiplicity[(multiplicity.counted == counted) & (multiplicity.solutions > 0)]
    return Share(int(rows[rows.solutions > more_than].inputs.sum()), int(rows.inputs.sum()))


def judged(folder: Path) -> list[Claim]:
    """All claims that can be measured, in the paper's order, then those about forces."""
    table = lambda name: pd.read_csv(folder / f"{name}.csv")
    trials = Trials(table("success"))
    disagreements = {row.disagreement: Share(row.trials, row.of) for row in table("disagreements").itertuples()}
    motions = table("motions")
    played = motions[(motions.solver == PUBLISHED) & (motions.step_ms == 1)]
    multiplicity = table("multiplicity")
    speed = table("speed").set_index(["start", "solver"])
    random, warm = (speed.loc[start] for start in ("random guess above the base", "solution 1 ms before, chewing"))
    solutions = table("fig8_solutions")
    return [
        movement_is_covered(played),
        *of_success(trials, disagreements),
        fewer_iterations(trials, random),
        *of_time(random, warm),
        *of_the_closest(trials),
        *of_solutions(solutions, multiplicity),
        always_the_true_one(trials),
        successive_poses(motions[motions.solver.isin(READINGS)]),
        friction(table("forces")),
        pressure(table("pressure"), table("pressed").iloc[0], table("pressures")),
    ]


def movement_is_covered(played: pd.DataFrame) -> Claim:
    def measured(motion) -> str:
        if not motion.within_limits:
            return f"{motion.motion}: {motion.refused}"
        left_mm = 1e3 * min(motion.least_slide_margin_m, motion.least_leg_margin_m)
        return f"{motion.motion}: {left_mm:.1f} mm of stroke left, condition at most {motion.greatest_condition:.1f}"

    return Claim(
        "The dimensions given cover the range of the human jaw's movement.", "Method 1",
        "; ".join(map(measured, played.itertuples())),
        "holds if the jaw stays within strokes and speeds at the 95th percentile of adults in opening, lateral excursion and "
        "protrusion; in part if only at the mean",
        verdict(bool(played.within_limits.all()), bool(played[~played.motion.str.contains("percentile")].within_limits.all())),
        "workspace_translation")


def of_success(trials: Trials, disagreements: dict[str, Share]) -> list[Claim]:
    solved, newton = (trials.solved(solver, ANYWHERE) for solver in (PUBLISHED, NEWTON))
    true_one, newton_true = (trials.true_ones(solver, ANYWHERE) for solver in (PUBLISHED, NEWTON))
    near = trials.solved(PUBLISHED, CLOSE)
    near_true, newton_near = (trials.true_ones(solver, CLOSE) for solver in (PUBLISHED, NEWTON))
    widest = trials.by_reading(lambda pair, cap: wider(*([rate(solver, ANYWHERE, cap) for solver in pair]
                                                         for rate in (trials.solved, trials.true_ones))))
    diverging, oscillating, stalling = (disagreements[name] for name in ("fig3_diverging", "fig4_oscillating", "fig3b_stalling"))
    return [
        Claim(
            "The algorithm converges whatever the initial guess.",
            "Korean summary, first advantage (the results section says otherwise)",
            "from guesses above the base it reached a solution in "
            + "; ".join(f"{trials.solved(reading, ANYWHERE)} ({reading})" for reading in READINGS),
            "holds if all guesses above the base converge as printed; in part if at least all within ±5° do",
            verdict(solved.is_all, near.is_all), "success"),
        Claim(
            "It converges for a wider range of guesses than Newton–Raphson.", "Abstract and Results, first advantage",
            f"any solution, as printed: {solved}, Newton–Raphson {newton}; the true one: {true_one} and {newton_true}; within 10 "
            f"iterations any: {trials.solved(PUBLISHED, ANYWHERE, 10)} and {trials.solved(NEWTON, ANYWHERE, 10)}, of jaw motions "
            f"{trials.solved(PUBLISHED, JAW_ANYWHERE, 10)} and {trials.solved(NEWTON, JAW_ANYWHERE, 10)}. The claim "
            + words(widest),
            "holds under a reading that reaches any solution from above the base more often than Newton–Raphson with the same residual "
            "and as many iterations, by 3 standard errors; in part if only the true one",
            over_readings(widest), "readings"),
        Claim(
            "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
            "Results, first advantage; Fig. 3",
            f"{diverging} of guesses above the base show this; the opposite, Newton–Raphson reaching a solution where the paper's "
            f"solver stalls, {stalling}",
            "holds if at least half of the guesses show it; in part if any does",
            verdict(diverging.value >= 0.5, diverging.hits > 0), "fig3_diverging"),
        Claim(
            "There are guesses from which the algorithm converges while Newton–Raphson oscillates for ever.",
            "Results, first advantage; Fig. 4",
            f"{oscillating} of guesses above the base ({oscillating.hits} of {oscillating.of})",
            "holds if any guess shows it: the last 40 errors repeat with a period of 2 to 8 iterations",
            verdict(oscillating.hits > 0, False), "fig4_oscillating"),
        Claim(
            "A guess close to the solution always makes it converge.", "Results, first advantage",
            f"within ±5° of the true angles it reached a solution in {near} ({near.hits} of {near.of}), the true one in {near_true} "
            f"(Newton–Raphson {newton_near}); within ±2° the true one in {trials.true_ones(PUBLISHED, (STROKES, '±2°'))}; of jaw "
            f"motions within ±5° the true one in {trials.true_ones(PUBLISHED, JAW_CLOSE)}",
            "holds if all guesses within ±5° converge; in part if 99 % do",
            verdict(near.is_all, near.value >= 1 - RARELY), "success"),
    ]


def fewer_iterations(trials: Trials, random: pd.DataFrame) -> Claim:
    def judge(pair, cap: int) -> str:
        row = trials.rows[ANYWHERE, pair[0], cap]
        return faster([row.iterations_median, row.newton_iterations_median], [row.iterations_p90, row.newton_iterations_p90])

    verdicts, printed = trials.by_reading(judge), trials.rows[ANYWHERE, PUBLISHED, 100]
    return Claim(
        "It converges much faster: Newton–Raphson needs many more iterations.", "Results, second advantage; Fig. 5",
        "within 100 iterations, where both reach a solution from above the base, medians as printed and of Newton–Raphson: "
        f"{printed.iterations_median:g} and {printed.newton_iterations_median:g} iterations, 90th percentiles "
        f"{printed.iterations_p90:g} and {printed.newton_iterations_p90:g}; time as printed "
        f"{random.ratio_of_medians_to_newton[PUBLISHED]:.2f} of Newton–Raphson's. The claim {words(verdicts)}",
        "holds under a reading if Newton–Raphson's median is at least twice as high; in part if it is higher, or if the 90th "
        "percentile is at least twice as high",
        over_readings(verdicts), "fig5_speed")


def of_time(random: pd.DataFrame, warm: pd.DataFrame) -> list[Claim]:
    published, newton, after = random.loc[PUBLISHED], random.loc[NEWTON], warm.loc[PUBLISHED]
    return [
        Claim(
            "The computation takes not more than 10⁻¹⁰ s on a Pentium.", "Results, second advantage",
            f"median from a random guess: the paper's solver {published.median_ns:.0f} ns, Newton–Raphson {newton.median_ns:.0f} ns on "
            "this machine; 10⁻¹⁰ s is less than one cycle of any Pentium's clock",
            "holds if the median here is not above 10⁻¹⁰ s",
            verdict(published.median_ns <= STATED_NS, False), "fig5_speed"),
        Claim(
            "It is fast enough for real-time control.", "Abstract and Results, second advantage",
            "median (99th percentile, which includes what else the machine does): from the solution 1 ms before "
            f"{after.median_ns:.0f} ns ({after.p99_ns:.0f} ns), from a random guess {published.median_ns:.0f} ns "
            f"({published.p99_ns:.0f} ns)",
            "holds if both medians are below a tenth of a 1 ms cycle; in part if the warm one is",
            verdict(max(after.median_ns, published.median_ns) <= REAL_TIME_NS, after.median_ns <= REAL_TIME_NS), "fig5_speed"),
    ]


def of_the_closest(trials: Trials) -> list[Claim]:
    closest = trials.by_reading(lambda pair, cap: reaches_the_closest(*(trials.closest(solver, ANYWHERE, cap) for solver in pair)))
    newton = {(solver, cap): cannot_be_predicted(*(trials.closest(solver, origin, cap) for origin in (CLOSE, JAW_CLOSE)))
              for solver in NEWTONS for cap in CAPS}
    shares = lambda origin, solvers: "; ".join(f"{trials.closest(solver, origin)} ({solver})" for solver in solvers)
    return [
        Claim(
            "It reaches the solution closest to the guess.", "Abstract and Results, third advantage",
            f"of the solutions reached from above the base, the closest: {shares(ANYWHERE, READINGS + NEWTONS)}. Of jaw motions from "
            f"within ±5°: {shares(JAW_CLOSE, [PUBLISHED, NEWTON])}. The claim {words(closest)}",
            "holds under a reading if at least 99 % of the solutions reached from above the base are the closest (largest difference of "
            "any leg's angle); in part if clearly more than of Newton–Raphson with the same residual and as many iterations",
            over_readings(closest), "readings"),
        Claim(
            "Which solution Newton–Raphson reaches cannot be predicted.", "Abstract and Results, third advantage",
            f"of the solutions reached from within ±5°, the closest: {shares(CLOSE, NEWTONS)}; of jaw motions {shares(JAW_CLOSE, NEWTONS)}",
            "holds with a residual if fewer than 99 % of the solutions reached from within ±5° are the closest, on jaw motions too; in "
            "part if only over the whole strokes",
            over_readings(newton), "basins"),
    ]


def folded(solutions: pd.DataFrame) -> tuple[pd.Series, pd.DataFrame]:
    """The true solution of the neutral input, and the one that differs from it in corner A₁ alone, if there is one."""
    truth = solutions[solutions.true == 1].iloc[0]
    same = [(solutions[f"theta{leg}_deg"] - truth[f"theta{leg}_deg"]).abs() < SAME_DEG for leg in (1, 2, 3)]
    return truth, solutions[~same[0] & same[1] & same[2]].head(1)


def of_solutions(solutions: pd.DataFrame, multiplicity: pd.DataFrame) -> list[Claim]:
    truth, second = folded(solutions)
    angles = [f"θ₁ = {truth.theta1_deg:.2f}° and {one.theta1_deg:.2f}° with θ₂ = θ₃ = {truth.theta2_deg:.2f}° in both"
              for one in second.itertuples()]
    inputs = multiplicity[multiplicity.counted == "all"]
    none = Share(int(inputs[inputs.solutions == 0].inputs.sum()), int(inputs.inputs.sum()))
    conditions = {name: several(multiplicity, name, 1) for name in multiplicity.counted.unique() if name != "all"}
    left = "; ".join(f"{name}: {share} ({share.hits} of {share.of})" for name, share in conditions.items())
    return [
        Claim(
            "With the slides in the middle, A₁ has two positions for the same A₂ and A₃.", "Results, on multiplicity; Fig. 6",
            angles[0] if angles else "no second solution with the same θ₂ and θ₃",
            "holds if both are among all solutions of the neutral input", verdict(bool(angles), False), "fig6_assemblies"),
        Claim(
            "One input has several sets of leg angles.", "Results, on multiplicity; Fig. 8",
            f"the neutral input has {len(solutions)}; of random inputs {none} have none, and of the others "
            f"{several(multiplicity, 'all', 2)} have more than one mirrored pair",
            "holds if the neutral input has more than one mirrored pair", verdict(len(solutions) > 2, False), "fig8_solutions"),
        Claim(
            "Two conditions leave exactly one solution, if any.", "Abstract and Results, on multiplicity",
            f"several are left — {left}",
            "holds if no random input keeps several with the plane oriented; in part if fewer than 1 % do. A sample cannot prove it: "
            "see masseter-research uniqueness",
            unique(conditions[ORIENTED]), None),
    ]


def always_the_true_one(trials: Trials) -> Claim:
    (anywhere, close, jaw), (controller, controller_close, _) = (
        [trials.true_ones(solver, origin) for origin in (ANYWHERE, CLOSE, JAW_CLOSE)] for solver in (PUBLISHED, CONTROLLER))
    return Claim(
        "In simulation the algorithm always reached the true solution, without exception.",
        "Results, on multiplicity; Korean summary",
        f"as printed {anywhere} from above the base, {close} from within ±5°, of jaw motions {jaw}; the controller's solver {controller} "
        f"and {controller_close}",
        "holds if every guess above the base leads to the true solution; in part if every one within ±5° of jaw motions does",
        verdict(anywhere.is_all, jaw.is_all), "success")


def successive_poses(followed: pd.DataFrame) -> Claim:
    lost, steps = followed.steps_lost.sum(), followed.steps.sum()
    most = followed.groupby("solver").iterations_max.max()
    return Claim(
        "Starting each step from the pose before, the true pose is found all along a movement.", "Results, last paragraph",
        f"{lost} of {steps} steps of 1, 10 and 100 ms lost over {followed.motion.nunique()} motions and all readings; iterations of a "
        "step at most " + ", ".join(f"{most[reading]} ({reading})" for reading in READINGS),
        "holds if no step is lost under any reading; in part if fewer than 1 % are",
        verdict(steps > 0 and lost == 0, lost < RARELY * steps), None)


def friction(forces: pd.DataFrame) -> Claim:
    """From the forces of the six drives in one chewing cycle."""
    kind = forces.axis.str[0].map({"d": "slides", "l": "legs"})
    rms = (forces.force_n ** 2).groupby([kind, forces.friction]).mean() ** 0.5
    words = [f"{name}: {rms[name, 'no friction']:.2f} N without friction, {rms[name, 'friction under load alone']:.2f} N with "
             f"friction under load alone, {rms[name, 'all friction']:.2f} N with all of it" for name in ("slides", "legs")]
    adds = lambda name: rms["slides", name] / rms["slides", "no friction"] - 1 > MATTERS
    return Claim(
        "Friction comes from the total weight of platform and legs.", "On friction",
        "rms force while chewing at 1.43 Hz — " + "; ".join(words),
        "holds if friction under load alone adds a tenth to the force of the slides; in part if only all of it does",
        verdict(adds("friction under load alone"), adds("all friction")), "forces")


def pressure(teeth: pd.DataFrame, pressed: pd.Series, courses: pd.DataFrame) -> Claim:
    hardest, total_mm2 = teeth.loc[teeth.mean_mpa.idxmax()], teeth.area_mm2.sum()
    foods = courses[courses.run != "pressed teeth"].groupby("run", sort=False)
    eaten = ", ".join(f"{food} {rows.mean_mpa.max():.2g} MPa over {rows.area_mm2.max():.0f} mm²" for food, rows in foods)
    course = courses[(courses.run == "pressed teeth") & (courses.mean_mpa > 0)]
    held = course[course.time_s <= course.time_s.max() - HELD_S].groupby("tooth").mean_mpa.last()
    balanced = abs(pressed.teeth_n / pressed.bite_n - 1) < BALANCED
    return Claim(
        "The robot reproduces the pressure between the jaws.", "On the jaws",
        f"{len(teeth)} lower teeth together bear {pressed.teeth_n:.1f} N at the peak of a bite that is controlled to {COMMANDED_N} N; the "
        f"bite force is {pressed.bite_n:.1f} N. They meet over {total_mm2:.3f} mm², on the average at {pressed.teeth_n / total_mm2:.0f} MPa; "
        f"most, {hardest.force_n:.1f} N, on tooth {hardest.tooth:.0f} over {hardest.area_mm2:.4f} mm² at {hardest.mean_mpa:.0f} MPa (peak "
        f"{hardest.peak_mpa:.0f} MPa). Food, at most: {eaten}. People bear most on the second molars (Satoh et al. 1996); here tooth "
        f"{hardest.tooth:.0f} does at the peak, and tooth {held.idxmax():.0f} ({held.max():.0f} MPa) while the force is held. The mean pressure grows with the force, as its cube root; measured, it does not change (Hidaka et al. 1999)",
        "holds if the teeth together and the bite force come within 5 % of the controlled one and the pressures are those of a published "
        "distribution; in part if the teeth together bear the bite force within 5 %. No distribution in MPa was found for such a bite, and "
        "the areas rest on the assumed radius of a cusp, so that it cannot hold",
        verdict(False, balanced), "pressure")
