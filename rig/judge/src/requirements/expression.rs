//! Expressions of signals, such as `abs({l1.force}) + abs({l2.force})`.
//!
//! An expression is read once, into steps in the order of their evaluation. The same steps give the value and
//! the dimension, so the two cannot disagree about priorities.

use std::convert::Infallible;
use std::f64::consts::{E, PI, TAU};

use masseter_scenario::{Dimension, input::excerpt};

use super::dimension::{BaseExponents, Misfit, Term};

/// Bytes of the longest expression.
const MOST_BYTES: usize = 4096;
/// Most parentheses around a part of an expression.
const MOST_LEVELS: usize = 64;

/// An expression that can be evaluated.
#[derive(Debug, Clone)]
pub(super) struct Expression {
    /// The column of each step, and the step: operands before what is applied to them.
    steps: Vec<(usize, Step)>,
    /// The name of the signal at each place where the expression has one.
    pub(super) signals: Vec<String>,
    /// Empty between evaluations.
    stack: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Number(f64),
    Signal(usize),
    One(&'static Function),
    Two(&'static Operator),
}

/// Why an expression is refused, and the column, from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("column {column}: {fault}")]
pub(super) struct ExpressionError {
    column: usize,
    fault: Fault,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Fault {
    #[error("it has {0} bytes: write at most {MOST_BYTES}")]
    TooLong(usize),
    #[error("parentheses are too deep: use at most {MOST_LEVELS} levels")]
    TooDeep,
    #[error("expected {expected}, found {found}")]
    Unexpected { expected: &'static str, found: String },
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

/// A sign or a function; it comes before every operator, so `-2^2` is 4.
#[derive(Debug)]
struct Function {
    name: &'static str,
    value: fn(f64) -> f64,
    dimension: fn(Term) -> Result<Term, Misfit>,
}

/// What stands between two operands, or before two in parentheses if it has a name. Equal priorities count from the left.
#[derive(Debug)]
struct Operator {
    name: &'static str,
    priority: u8,
    value: fn(f64, f64) -> f64,
    dimension: fn(Term, Term) -> Result<Term, Misfit>,
}

static FUNCTIONS: [Function; 28] = [
    Function { name: "+", value: |a| a, dimension: Ok },
    Function { name: "-", value: |a| -a, dimension: |a| Ok(a.negated()) },
    Function { name: "abs", value: f64::abs, dimension: |a| Ok(a.kept()) },
    Function { name: "floor", value: f64::floor, dimension: |a| Ok(a.kept()) },
    Function { name: "round", value: f64::round, dimension: |a| Ok(a.kept()) },
    Function { name: "ceil", value: f64::ceil, dimension: |a| Ok(a.kept()) },
    Function { name: "trunc", value: f64::trunc, dimension: |a| Ok(a.kept()) },
    Function { name: "fract", value: f64::fract, dimension: |a| Ok(a.kept()) },
    Function { name: "signum", value: f64::signum, dimension: |_| Ok(Term::NUMBER) },
    Function { name: "sqrt", value: f64::sqrt, dimension: |a| a.root(2.0) },
    Function { name: "cbrt", value: f64::cbrt, dimension: |a| a.root(3.0) },
    Function { name: "sin", value: f64::sin, dimension: Term::function },
    Function { name: "cos", value: f64::cos, dimension: Term::function },
    Function { name: "tan", value: f64::tan, dimension: Term::function },
    Function { name: "asin", value: f64::asin, dimension: Term::function },
    Function { name: "acos", value: f64::acos, dimension: Term::function },
    Function { name: "atan", value: f64::atan, dimension: Term::function },
    Function { name: "sinh", value: f64::sinh, dimension: Term::function },
    Function { name: "cosh", value: f64::cosh, dimension: Term::function },
    Function { name: "tanh", value: f64::tanh, dimension: Term::function },
    Function { name: "asinh", value: f64::asinh, dimension: Term::function },
    Function { name: "acosh", value: f64::acosh, dimension: Term::function },
    Function { name: "atanh", value: f64::atanh, dimension: Term::function },
    Function { name: "exp", value: f64::exp, dimension: Term::function },
    Function { name: "ln", value: f64::ln, dimension: Term::function },
    Function { name: "log", value: f64::ln, dimension: Term::function },
    Function { name: "log2", value: f64::log2, dimension: Term::function },
    Function { name: "log10", value: f64::log10, dimension: Term::function },
];

static OPERATORS: [Operator; 8] = [
    Operator { name: "+", priority: 0, value: |a, b| a + b, dimension: |a, b| a.alike(b, "+") },
    Operator { name: "-", priority: 1, value: |a, b| a - b, dimension: |a, b| a.alike(b, "-") },
    Operator { name: "*", priority: 2, value: |a, b| a * b, dimension: |a, b| a.product(b, 1) },
    Operator { name: "/", priority: 3, value: |a, b| a / b, dimension: |a, b| a.product(b, -1) },
    Operator { name: "^", priority: 4, value: f64::powf, dimension: Term::power },
    Operator { name: "min", priority: 0, value: f64::min, dimension: |a, b| a.alike(b, "min") },
    Operator { name: "max", priority: 0, value: f64::max, dimension: |a, b| a.alike(b, "max") },
    Operator {
        name: "atan2",
        priority: 0,
        value: f64::atan2,
        dimension: |a, b| a.alike(b, "atan2").and(Ok(Term::NUMBER)),
    },
];

impl Expression {
    /// # Errors
    /// Where the text is no expression, with the expected text; or is too long or too deep.
    pub(super) fn read(text: &str) -> Result<Self, ExpressionError> {
        if text.len() > MOST_BYTES {
            return Err(ExpressionError { column: 1, fault: Fault::TooLong(text.len()) });
        }
        let read = Self { steps: Vec::new(), signals: Vec::new(), stack: Vec::new() };
        let mut reader = Reader { token: "", column: 1, rest: text, levels: 0, read };
        reader.advance();
        reader.operation(0)?;
        reader.pass("", "an operator or the end")?;
        Ok(reader.read)
    }

    /// Its value; `of` gives that of each of its signals.
    pub(super) fn value(&mut self, of: impl Fn(usize) -> f64) -> f64 {
        let one = |function: &Function, a| Ok::<_, Infallible>((function.value)(a));
        let two = |operator: &Operator, a, b| Ok((operator.value)(a, b));
        let Ok(value) = evaluate(&self.steps, &mut self.stack, |number| number, of, one, two);
        value
    }

    /// Its dimension; `of` gives that of each of its signals.
    ///
    /// # Errors
    /// The function or operator whose operands have units that do not fit.
    pub(super) fn dimension(
        &self,
        of: impl Fn(usize) -> Dimension,
    ) -> Result<BaseExponents, ExpressionError> {
        let signal = |place| Term::of(BaseExponents::of(of(place)));
        let one = |function: &Function, a| (function.dimension)(a);
        let two = |operator: &Operator, a, b| (operator.dimension)(a, b);
        match evaluate(&self.steps, &mut Vec::new(), Term::written, signal, one, two) {
            Ok(term) => Ok(term.dimension),
            Err((column, misfit)) => Err(ExpressionError { column, fault: misfit.into() }),
        }
    }
}

/// Evaluates the steps with numbers or with dimensions; the error has the column of its step.
fn evaluate<T, F>(
    steps: &[(usize, Step)],
    stack: &mut Vec<T>,
    number: impl Fn(f64) -> T,
    signal: impl Fn(usize) -> T,
    one: impl Fn(&Function, T) -> Result<T, F>,
    two: impl Fn(&Operator, T, T) -> Result<T, F>,
) -> Result<T, (usize, F)> {
    for (column, step) in steps {
        let mut operand = || stack.pop().expect("operands are before what is applied to them");
        let result = match *step {
            Step::Number(value) => Ok(number(value)),
            Step::Signal(place) => Ok(signal(place)),
            Step::One(function) => one(function, operand()),
            Step::Two(operator) => {
                let (b, a) = (operand(), operand());
                two(operator, a, b)
            }
        };
        stack.push(result.map_err(|misfit| (*column, misfit))?);
    }
    Ok(stack.pop().expect("an expression has an operand"))
}

/// Reads by recursive descent, which goes as deep as parentheses may be nested.
struct Reader<'a> {
    /// A name, a number, a signal with its braces, or any other character; empty at the end.
    token: &'a str,
    column: usize,
    rest: &'a str,
    levels: usize,
    read: Expression,
}

impl Reader<'_> {
    fn advance(&mut self) {
        let next = self.rest.trim_start();
        let spaces = &self.rest[..self.rest.len() - next.len()];
        self.column += self.token.chars().count() + spaces.chars().count();
        let length_of = |is_part: fn(char) -> bool| next.find(|c: char| !is_part(c)).unwrap_or(next.len());
        let length = match next.chars().next() {
            Some('{') => next.find('}').map_or(1, |end| end + 1),
            Some('0'..='9' | '.') => length_of(|c| c.is_ascii_digit() || c == '.'),
            Some(c) if c.is_alphabetic() => length_of(|c| c.is_alphanumeric() || c == '_'),
            other => other.map_or(0, char::len_utf8),
        };
        (self.token, self.rest) = next.split_at(length);
    }

    /// Operands, and between them operators of this priority or a higher one.
    fn operation(&mut self, priority: u8) -> Result<(), ExpressionError> {
        self.operand()?;
        let follows = |name: &str| OPERATORS.iter().find(|o| o.name == name && o.priority >= priority);
        while let Some(operator) = follows(self.token) {
            let column = self.column;
            self.advance();
            self.operation(operator.priority + 1)?;
            self.read.steps.push((column, Step::Two(operator)));
        }
        Ok(())
    }

    fn operand(&mut self) -> Result<(), ExpressionError> {
        let mut functions = Vec::new();
        while let Some(function) = FUNCTIONS.iter().find(|function| function.name == self.token) {
            functions.push((self.column, Step::One(function)));
            self.advance();
        }
        let (column, token) = (self.column, self.token);
        if token == "(" {
            self.parenthesised(false)?;
        } else if let Some(operator) = OPERATORS.iter().find(|o| o.name == token && o.name.len() > 1) {
            self.advance();
            self.parenthesised(true)?;
            self.read.steps.push((column, Step::Two(operator)));
        } else {
            let leaf = self.leaf()?;
            self.read.steps.push((column, leaf));
            self.advance();
        }
        self.read.steps.extend(functions.into_iter().rev());
        Ok(())
    }

    fn leaf(&mut self) -> Result<Step, ExpressionError> {
        if let Some(name) = self.token.strip_prefix('{').and_then(|token| token.strip_suffix('}')) {
            self.read.signals.push(name.to_owned());
            return Ok(Step::Signal(self.read.signals.len() - 1));
        }
        let number = match self.token {
            "PI" | "π" => Some(PI),
            "TAU" | "τ" => Some(TAU),
            "E" | "e" => Some(E),
            // Words such as inf are numbers for `parse` alone.
            token => token.parse().ok().filter(|_| !token.starts_with(char::is_alphabetic)),
        };
        let expected = "a number, a signal in braces such as {l1.force}, a function or '('";
        number.map(Step::Number).ok_or_else(|| self.unexpected(expected))
    }

    /// The text in parentheses: two operations with a comma between them, or one.
    fn parenthesised(&mut self, has_two: bool) -> Result<(), ExpressionError> {
        self.levels += 1;
        if self.levels > MOST_LEVELS {
            return Err(ExpressionError { column: self.column, fault: Fault::TooDeep });
        }
        self.pass("(", "'('")?;
        self.operation(0)?;
        if has_two {
            self.pass(",", "an operator or ','")?;
            self.operation(0)?;
        }
        self.levels -= 1;
        self.pass(")", "an operator or ')'")
    }

    fn pass(&mut self, token: &str, expected: &'static str) -> Result<(), ExpressionError> {
        if self.token != token {
            return Err(self.unexpected(expected));
        }
        self.advance();
        Ok(())
    }

    fn unexpected(&self, expected: &'static str) -> ExpressionError {
        let found =
            if self.token.is_empty() { "the end".into() } else { format!("'{}'", excerpt(self.token)) };
        ExpressionError { column: self.column, fault: Fault::Unexpected { expected, found } }
    }
}

#[cfg(test)]
mod tests;
