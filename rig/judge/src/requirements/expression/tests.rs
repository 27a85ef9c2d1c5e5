use proptest::prelude::*;

use super::*;

static SIGNALS: [(&str, f64); 4] = [("a", 7.25), ("b", -3.5), ("c", 0.3), ("d", 2.0)];

fn value(text: &str) -> f64 {
    let mut expression = Expression::read(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let names = expression.signals.clone();
    expression.value(|place| SIGNALS.iter().find(|(name, _)| *name == names[place]).unwrap().1)
}

fn assert_value(text: &str, expected: f64) {
    let found = value(text);
    assert!((found - expected).abs() <= 1e-14 * expected.abs(), "{text} = {found:?}, not {expected:?}");
}

/// The values are those of the crate `exmex` 0.21.
#[test]
fn operators_have_priorities_and_functions_come_before_them() {
    for (text, expected) in [
        ("1 + 2 * 3", 7.0),
        ("{a} - {b} - {c}", 10.45),
        ("{a} - {b} + {c}", 11.05),
        ("{a} + {b} - {c} + {d}", 5.45),
        ("{a} / {b} / {c}", -6.904_761_904_761_906),
        ("{a} / {b} * {c}", -0.621_428_571_428_571_4),
        ("{a} * {b} / {c} * {d}", -169.166_666_666_666_69),
        ("{a} / {b} ^ {d}", 0.591_836_734_693_877_5),
        ("2 ^ 3 ^ 2", 64.0),
        ("-2 ^ 2", 4.0),
        ("-{b} ^ {d}", 12.25),
        ("2 ^ -2 ^ 2", 0.062_5),
        ("{a} ^ -1", 0.137_931_034_482_758_62),
        ("-(2 ^ 2)", -4.0),
        ("2 * -{a}", -14.5),
        ("2 - - -{a}", -5.25),
        ("-+{a}", -7.25),
        ("-abs({b})", -3.5),
        ("- abs -{b}", -3.5),
        ("abs {b} - 1", 2.5),
        ("sin {c} ^ 2", 0.087_332_192_545_160_84),
        ("sqrt {d} * {d}", 2.828_427_124_746_190_3),
        ("-sqrt({d}) ^ 2", 2.000_000_000_000_000_4),
        ("min({a}, {b})", -3.5),
        ("max({a}, 0) * 2", 14.5),
        ("2 * min({a}, {b}) + 1", -6.0),
        ("min({a} + {b}, {c} * {d})", 0.6),
        ("min({a} + 1, 2) ^ 2", 4.0),
        ("-min({a}, {b})", 3.5),
        ("min(max({a}, {b}), {c})", 0.3),
        ("max(abs({a}), abs({b}))", 7.25),
        ("max(({a}), -({b}))", 7.25),
        ("min({a} * ({b} + {c}), {d})", -23.200_000_000_000_003),
        ("min({a}, {b}) * max({c}, {d})", -7.0),
        ("atan2({a}, {b})", 2.020_555_939_864_735_7),
        ("atan2({a}, ({b} + {c}) * 2)", 2.294_003_730_363_472),
        ("{a} min {b} + 3", -0.5),
        ("3 max 5 * 2", 10.0),
        ("signum({b})", -1.0),
        ("sin({a})", 0.823_080_879_011_505_5),
        ("cos({a})", 0.567_924_173_288_694_8),
        ("tan({a})", 1.449_279_530_126_825_3),
        ("asin({c})", 0.304_692_654_015_397_5),
        ("acos({c})", 1.266_103_672_779_499_2),
        ("atan({a})", 1.433_730_152_484_709),
        ("sinh({c})", 0.304_520_293_447_142_6),
        ("cosh({c})", 1.045_338_514_128_860_5),
        ("tanh({c})", 0.291_312_612_451_590_9),
        ("asinh({a})", 2.678_871_313_462_426),
        ("acosh({a})", 2.669_358_110_903_154),
        ("atanh({c})", 0.309_519_604_203_111_75),
        ("floor({b})", -4.0),
        ("round({b})", -4.0),
        ("ceil({b})", -3.0),
        ("trunc({b})", -3.0),
        ("fract({b})", -0.5),
        ("exp({c})", 1.349_858_807_576_003_2),
        ("sqrt({a})", 2.692_582_403_567_252),
        ("cbrt({b})", -1.518_294_485_937_831_3),
        ("ln({a})", 1.981_001_468_866_583_3),
        ("log2({a})", 2.857_980_995_127_572_3),
        ("log10({a})", 0.860_338_006_570_993_7),
        ("log({a})", 1.981_001_468_866_583_3),
        ("PI + 2 * π", 9.424_777_960_769_38),
        ("E - e / 2", 1.359_140_914_229_522_5),
        ("TAU * τ", 39.478_417_604_357_43),
        ("{a} * e ^ {c}", 9.786_476_354_926_021),
        (".5 + 5. + 05", 10.5),
        ("0.1 + 0.2", 0.300_000_000_000_000_04),
        ("((({a})))", 7.25),
        ("sqrt({a}^2+{b}^2)", 8.050_621_094_052_309),
        ("({a} + {b} + {c}) / 3", 1.349_999_999_999_999_9),
        ("  {a}   +   {b}  ", 3.75),
        ("-(-({a} - {b}) - {c})", 11.05),
        ("abs({a} * {b} - {c}) ^ 2 / {d}", 329.602_812_5),
        ("{a} * 2 * 3 * {b}", -152.25),
        ("2 / 3 * {a}", 4.833_333_333_333_333),
        ("max(sqrt(-1), {a})", 7.25),
        ("sin(({a} + {b}) * ({c} + {d}))", 0.717_201_376_995_745_6),
        ("2 ^ ({a} - {b} - {c})", 1_398.825_222_916_500_3),
    ] {
        assert_value(text, expected);
    }
}

#[test]
fn functions_of_two_operands_may_be_in_each_other() {
    assert_value("min({a}, max({b}, {c}))", 0.3);
    assert_value("max(\n  min({a}, {b}),\n  min({c}, {d})\n)", 0.3);
    assert!(value("sqrt({b})").is_nan());
}

#[test]
fn a_refusal_names_the_column_what_is_expected_and_what_is_found() {
    let operand = "expected a number, a signal in braces such as {l1.force}, a function or '(', found";
    let end = "expected an operator or the end, found";
    for (text, column, reason) in [
        ("", 1, format!("{operand} the end")),
        ("  ", 3, format!("{operand} the end")),
        ("{a} +", 6, format!("{operand} the end")),
        ("{a} + )", 7, format!("{operand} ')'")),
        ("{a} * / {b}", 7, format!("{operand} '/'")),
        ("* 3 4", 1, format!("{operand} '*'")),
        ("π + µ", 5, format!("{operand} 'µ'")),
        ("l1.force", 1, format!("{operand} 'l1'")),
        ("1 + {a", 5, format!("{operand} '{{'")),
        ("{a} - sine({b})", 7, format!("{operand} 'sine'")),
        ("inf - nan", 1, format!("{operand} 'inf'")),
        ("1.2.3", 1, format!("{operand} '1.2.3'")),
        (".", 1, format!("{operand} '.'")),
        ("()", 2, format!("{operand} ')'")),
        ("sin", 4, format!("{operand} the end")),
        ("2{a}", 2, format!("{end} '{{a}}'")),
        ("1e-3", 2, format!("{end} 'e'")),
        ("{a} ({b})", 5, format!("{end} '('")),
        ("{a} % 2", 5, format!("{end} '%'")),
        ("{a}, {b}", 4, format!("{end} ','")),
        ("{a})", 4, format!("{end} ')'")),
        ("{a}}", 4, format!("{end} '}}'")),
        ("({a}", 5, "expected an operator or ')', found the end".into()),
        ("sin({a}, {b})", 8, "expected an operator or ')', found ','".into()),
        ("max({a}, {b}, {c})", 13, "expected an operator or ')', found ','".into()),
        ("min({a})", 8, "expected an operator or ',', found ')'".into()),
        ("min {a}", 5, "expected '(', found '{a}'".into()),
    ] {
        let error = Expression::read(text).unwrap_err();
        assert_eq!(error.to_string(), format!("column {column}: {reason}"), "{text}");
    }
}

#[test]
fn parentheses_have_a_limit_and_signs_need_none() {
    for opening in ["(", "-(", "abs(", "1 + 2 * 3 / 4 ^ (", "max(0, "] {
        let nested = |levels: usize| format!("{}{{a}}{}", opening.repeat(levels), ")".repeat(levels));
        assert!(Expression::read(&nested(MOST_LEVELS)).is_ok(), "{opening}");
        let error = Expression::read(&nested(MOST_LEVELS + 1)).unwrap_err();
        let column = MOST_LEVELS * opening.len() + opening.find('(').unwrap() + 1;
        assert_eq!(error, ExpressionError { column, fault: Fault::TooDeep }, "{opening}");
    }
    assert_value(&format!("{}{{a}}", "-".repeat(4000)), 7.25);
    assert_value(&format!("{{a}}{}", "+1".repeat(2000)), 2007.25);
    let error = Expression::read(&"1+".repeat(3000)).unwrap_err();
    assert_eq!(error.to_string(), "column 1: it has 6000 bytes: write at most 4096");
}

fn unit(text: &str) -> Result<String, String> {
    let expression = Expression::read(text).unwrap();
    let of = |place: usize| match expression.signals[place].as_str() {
        "f" => Dimension::Force,
        "v" => Dimension::Velocity,
        "x" => Dimension::Length,
        "phi" => Dimension::Angle,
        "m" => Dimension::Mass,
        _ => Dimension::One,
    };
    expression.dimension(of).map(|unit| unit.to_string()).map_err(|error| error.to_string())
}

#[test]
fn units_follow_from_those_of_the_signals() {
    for (text, expected) in [
        ("abs({f} - 2 * {f})", "N"),
        ("{f} * {v}", "W"),
        ("{f} * {x}", "J"),
        ("{f} / {m}", "m/s2"),
        ("sqrt({x}^2 + {x} * {x})", "m"),
        ("{x}^-1", "1/m"),
        ("-{x}^2", "m2"),
        ("cbrt({x}^3) / {v}", "s"),
        ("{m} * {x}^2", "m2 kg"),
        ("{f} / {x}^2", "Pa"),
        ("{f} / {x}^3", "kg/m2 s2"),
        ("sin({phi}) + exp({f} / {f}) + 1", "a number"),
        ("atan2({x}, {x})", "a number"),
        ("signum({f}) + 1", "a number"),
        ("{n}^2.5 + {n}^{n}", "a number"),
        ("max({f}, 0) + (-0)", "N"),
        ("0 - {f}", "N"),
        ("{phi} * {x}", "m"),
    ] {
        assert_eq!(unit(text).as_deref(), Ok(expected), "{text}");
    }
}

#[test]
fn what_does_not_fit_is_refused_with_both_units() {
    for (text, message) in [
        ("{f} + {x}", "column 5: '+' needs two equal units, not N and m"),
        ("{f} - 5", "column 5: '-' needs two equal units, not N and a number"),
        ("{f} + abs(0)", "column 5: '+' needs two equal units, not N and a number"),
        ("min({f}, {v})", "column 1: 'min' needs two equal units, not N and m/s"),
        ("2 - sin({x})", "column 5: a function such as sin or exp needs a number or an angle, not m"),
        ("sqrt({x})", "column 1: no unit is m to the power of 0.5"),
        ("{x}^{n}", "column 4: the exponent of m must be written as a number"),
        ("{n}^{x}", "column 4: an exponent has no unit, but this one has m"),
        ("2 * ({f} + {x})", "column 10: '+' needs two equal units, not N and m"),
        ("{x}^100 * {x}^100", "column 9: the product of m100 and m100 is beyond every unit"),
    ] {
        assert_eq!(unit(text).unwrap_err(), message, "{text}");
    }
}

/// An expression with every parenthesis, with the necessary ones alone, and what its operators give.
#[derive(Debug, Clone)]
struct Written {
    explicit: String,
    terse: String,
    priority: u8,
    value: f64,
}

impl Written {
    fn one(function: &Function, of: &Self) -> Self {
        let (name, terse) = (function.name, of.within(u8::MAX));
        Self {
            explicit: format!("{name}({})", of.explicit),
            terse: format!("{name} {terse}"),
            priority: u8::MAX,
            value: (function.value)(of.value),
        }
    }

    fn two(operator: &Operator, left: &Self, right: &Self) -> Self {
        let &Operator { name, priority, .. } = operator;
        Self {
            explicit: match name.len() {
                1 => format!("({} {name} {})", left.explicit, right.explicit),
                _ => format!("{name}({}, {})", left.explicit, right.explicit),
            },
            terse: format!("{} {name} {}", left.within(priority), right.within(priority + 1)),
            priority,
            value: (operator.value)(left.value, right.value),
        }
    }

    fn within(&self, priority: u8) -> String {
        if self.priority < priority { format!("({})", self.terse) } else { self.terse.clone() }
    }
}

fn written() -> impl Strategy<Value = Written> {
    let leaf = prop::sample::select(&SIGNALS[..]).prop_map(|(name, value)| {
        let text = format!("{{{name}}}");
        Written { explicit: text.clone(), terse: text, priority: u8::MAX, value }
    });
    leaf.prop_recursive(6, 64, 2, |part| {
        let one = (0..FUNCTIONS.len(), part.clone());
        let two = (0..OPERATORS.len(), part.clone(), part);
        prop_oneof![
            1 => one.prop_map(|(at, of)| Written::one(&FUNCTIONS[at], &of)),
            2 => two.prop_map(|(at, left, right)| Written::two(&OPERATORS[at], &left, &right)),
        ]
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read(written in written()) {
        for text in [&written.explicit, &written.terse] {
            let (read, expected) = (value(text), written.value);
            prop_assert!(read.to_bits() == expected.to_bits() || read.is_nan() && expected.is_nan(), "{}", text);
        }
    }

    #[test]
    fn any_text_is_read_or_refused_at_one_of_its_columns(
        text in prop_oneof![".{0,40}", "(\\PC|[-+*/^(),{} ]|min|sin |π|[0-9.]{1,3}|\\{a\\}){0,40}"]
    ) {
        match Expression::read(&text) {
            Ok(mut expression) => drop((expression.dimension(|_| Dimension::Force), expression.value(|_| 1.0))),
            Err(error) => prop_assert!((1..=text.chars().count() + 1).contains(&error.column), "{}", error),
        }
    }
}
