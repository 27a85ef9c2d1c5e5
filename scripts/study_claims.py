"""The paper's claims, judged by the tables of a study. The criteria are defined here alone; each is a function of measured values,
so that other values give another judgement. scripts/study.py writes them into study.html.
"""
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import pandas as pd

ANYWHERE, CLOSE = "above base", "±5°"
PUBLISHED, NEWTON, CONTROLLER = "published, distances, halving", "Newton–Raphson, distances", "controller"
ORIENTED = "conditions 1 and 2, plane oriented"
# A rule that fails in a smaller share of cases nearly holds.
RARELY = 0.01
# The time the paper states for one computation, ns.
STATED_NS = 0.1
# Share of a real-time cycle of 1 ms for one solution, ns: a tenth.
REAL_TIME_NS = 1e5
# How many times more iterations are "much more".
MUCH_MORE = 2
# Share of the force without friction above which friction matters.
MATTERS = 0.1
# Largest difference between the forces of the teeth and the bite force, as a share.
BALANCED = 0.05
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
    # When it holds, and when it holds partly.
    criterion: str
    verdict: str
    figure: str | None


def verdict(holds: bool, partly: bool) -> str:
    return "holds" if holds else "holds partly" if partly else "does not hold"


def is_predictable(closest: Share) -> bool:
    """One criterion for two claims: 99 % of the solutions reached are the closest ones."""
    return closest.of > 0 and closest.value >= 1 - RARELY


def reaches_the_closest(anywhere: Share, close: Share) -> str:
    return verdict(is_predictable(anywhere), is_predictable(close))


def cannot_be_predicted(anywhere: Share, close: Share) -> str:
    return verdict(not is_predictable(close), not is_predictable(anywhere))


def wider(published: Share, newton: Share, best_variant: Share) -> str:
    return verdict(published.clearly_exceeds(newton), best_variant.clearly_exceeds(newton))


def unique(several: Share) -> str:
    return verdict(several.of > 0 and several.hits == 0, several.value < RARELY)


def faster(published: float, newton: float) -> str:
    return verdict(newton >= MUCH_MORE * published, newton > published)


class Trials:
    """Shares of the table of success rates."""

    def __init__(self, success: pd.DataFrame):
        self.rows = {(row.guesses, row.solver): row for row in success.itertuples()}

    def solved(self, solver: str, guesses: str) -> Share:
        row = self.rows[guesses, solver]
        return Share(row.reached_true + row.reached_other, row.trials)

    def true_ones(self, solver: str, guesses: str) -> Share:
        row = self.rows[guesses, solver]
        return Share(row.reached_true, row.trials)

    def closest(self, solver: str, guesses: str) -> Share:
        return Share(self.rows[guesses, solver].reached_closest, self.solved(solver, guesses).hits)

    def best_variant(self) -> tuple[str, Share]:
        """The paper's variant that most often reaches a solution from above the base, and how often it does."""
        variants = [solver for guesses, solver in self.rows if guesses == ANYWHERE and solver.startswith("published")]
        shares = [(solver, self.solved(solver, ANYWHERE)) for solver in variants]
        most = max(share.value for _, share in shares)
        return [one for one in shares if one[1].value == most][-1]


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
    played = motions[motions.solver == "published"]
    multiplicity = table("multiplicity")
    speed = table("speed").set_index(["start", "solver"])
    random, warm = (speed.loc[start] for start in ("random guess above the base", "solution 1 ms before, chewing"))
    cost = table("cost")
    cost = cost[(cost.guesses == ANYWHERE) & (cost.solver == PUBLISHED)].iloc[0]
    solutions = table("fig8_solutions")
    return [
        movement_is_covered(played),
        *of_success(trials, disagreements),
        fewer_iterations(cost, random),
        *of_time(random, warm),
        *of_the_closest(trials),
        *of_solutions(solutions, multiplicity),
        always_the_true_one(trials),
        successive_poses(played),
        friction(table("forces")),
        pressure(table("pressure"), table("pressed").iloc[0]),
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
        "holds if every motion stays within strokes, speeds and conditioning, with openings of 44 and 56 mm (mean and 95th "
        "percentile of adults); partly if any does",
        verdict(bool(played.within_limits.all()), bool(played.within_limits.any())), "workspace_translation")


def of_success(trials: Trials, disagreements: dict[str, Share]) -> list[Claim]:
    solved, newton = (trials.solved(solver, ANYWHERE) for solver in (PUBLISHED, NEWTON))
    true_one, newton_true = (trials.true_ones(solver, ANYWHERE) for solver in (PUBLISHED, NEWTON))
    near = trials.solved(PUBLISHED, CLOSE)
    near_true, newton_near = (trials.true_ones(solver, CLOSE) for solver in (PUBLISHED, NEWTON))
    variant, best = trials.best_variant()
    diverging, oscillating, stalling = (disagreements[name] for name in ("fig3_diverging", "fig4_oscillating", "fig3b_stalling"))
    return [
        Claim(
            "The algorithm converges whatever the initial guess.",
            "Korean summary, first advantage (the results section says otherwise)",
            f"from guesses above the base the paper's solver reached a solution in {solved}; its best variant ({variant}) in {best}",
            "holds if all guesses above the base converge; partly if at least all within ±5° do",
            verdict(solved.is_all, near.is_all), "success"),
        Claim(
            "It converges for a wider range of guesses than Newton–Raphson.", "Abstract and Results, first advantage",
            f"any solution: published {solved}, Newton–Raphson {newton}; the true one: {true_one} and {newton_true}; published alone "
            f"{disagreements['published_alone']}, Newton–Raphson alone {disagreements['newton_alone']}; best variant of the paper "
            f"({variant}) {best}",
            "holds if the paper's solver as printed reaches a solution more often from above the base, by 3 standard errors; partly "
            "if only a variant of it does",
            wider(solved, newton, best), "success"),
        Claim(
            "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
            "Results, first advantage; Fig. 3",
            f"{diverging} of guesses above the base show this; the opposite, Newton–Raphson reaching a solution where the paper's "
            f"solver stalls, {stalling}",
            "holds if at least half of the guesses show it; partly if any does",
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
            f"(Newton–Raphson {newton_near}); within ±2° the true one in {trials.true_ones(PUBLISHED, '±2°')}",
            "holds if all guesses within ±5° converge; partly if 99 % do",
            verdict(near.is_all, near.value >= 1 - RARELY), "success"),
    ]


def fewer_iterations(cost: pd.Series, random: pd.DataFrame) -> Claim:
    return Claim(
        "It converges much faster: Newton–Raphson needs many more iterations.", "Results, second advantage; Fig. 5",
        "where both reach a solution from above the base, medians of the paper's solver and Newton–Raphson: "
        f"{cost.iterations_median:g} and {cost.newton_iterations_median:g} iterations, {cost.evaluations_median:g} and "
        f"{cost.newton_evaluations_median:g} evaluations of the residuals; time of the paper's solver "
        f"{random.ratio_of_medians_to_newton[PUBLISHED]:.2f} of Newton–Raphson's",
        "holds if Newton–Raphson's median is at least twice the paper's; partly if it is greater",
        faster(cost.iterations_median, cost.newton_iterations_median), "fig5_speed")


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
            "holds if both medians are below a tenth of a 1 ms cycle; partly if the warm one is",
            verdict(max(after.median_ns, published.median_ns) <= REAL_TIME_NS, after.median_ns <= REAL_TIME_NS), "fig5_speed"),
    ]


def of_the_closest(trials: Trials) -> list[Claim]:
    published, newton = ([trials.closest(solver, guesses) for guesses in (ANYWHERE, CLOSE)] for solver in (PUBLISHED, NEWTON))
    measured = (
        f"of the solutions reached from above the base, the closest: the paper's solver {published[0]}, Newton–Raphson {newton[0]}; "
        f"from within ±5° of the true one: {published[1]} and {newton[1]}")
    return [
        Claim(
            "It reaches the solution closest to the guess.", "Abstract and Results, third advantage", measured,
            "holds if at least 99 % of the solutions that the paper's solver reaches from above the base are the closest (largest "
            "difference of any leg's angle); partly if at least from within ±5°",
            reaches_the_closest(*published), "basins"),
        Claim(
            "Which solution Newton–Raphson reaches cannot be predicted.", "Abstract and Results, third advantage", measured,
            "the criterion of the claim before, turned round: holds if fewer than 99 % of the solutions that Newton–Raphson reaches "
            "from within ±5° are the closest; partly if only from above the base",
            cannot_be_predicted(*newton), "basins"),
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
            "holds if no random input keeps several with the plane oriented; partly if fewer than 1 % do. A sample cannot prove it: "
            "see masseter-research uniqueness",
            unique(conditions[ORIENTED]), None),
    ]


def always_the_true_one(trials: Trials) -> Claim:
    (anywhere, close), (controller, controller_close) = (
        [trials.true_ones(solver, guesses) for guesses in (ANYWHERE, CLOSE)] for solver in (PUBLISHED, CONTROLLER))
    return Claim(
        "In simulation the algorithm always reached the true solution, without exception.",
        "Results, on multiplicity; Korean summary",
        f"the paper's solver {anywhere} from above the base, {close} from within ±5°; the controller's solver {controller} and "
        f"{controller_close}",
        "holds if every guess above the base leads to the true solution; partly if every one within ±5° does",
        verdict(anywhere.is_all, close.is_all), "success")


def successive_poses(played: pd.DataFrame) -> Claim:
    lost, steps = played.steps_lost.sum(), played.steps_of_1ms.sum()
    return Claim(
        "Starting each step from the pose before, the true pose is found all along a movement.", "Results, last paragraph",
        f"{lost} of {steps} steps of 1 ms lost over {len(played)} motions; {played.iterations_mean.iloc[0]:.1f} iterations a step "
        "while chewing",
        "holds if no step is lost; partly if fewer than 1 % are", verdict(steps > 0 and lost == 0, lost < RARELY * steps), None)


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
        "holds if friction under load alone adds a tenth to the force of the slides; partly if only all of it does",
        verdict(adds("friction under load alone"), adds("all friction")), "forces")


def pressure(teeth: pd.DataFrame, pressed: pd.Series) -> Claim:
    most = teeth.loc[teeth.greatest_n.idxmax()]
    return Claim(
        "The robot reproduces the pressure between the jaws.", "On the jaws",
        f"{len(teeth)} lower teeth together bear {pressed.teeth_n:.1f} N at the peak of a bite that is controlled to 60 N; most, "
        f"{most.greatest_n:.1f} N, tooth {most.tooth:.0f}; the bite force is {pressed.bite_n:.1f} N",
        "holds if the teeth together bear the bite force within 5 %; friction between them is the rest",
        verdict(abs(pressed.teeth_n / pressed.bite_n - 1) < BALANCED, False), "pressure")
