//! Which scenarios of a suite run: an expression over their names and tags, and a share for one of several machines.

use std::str::FromStr;

/// Characters of the longest expression.
const LONGEST: usize = 1000;

/// An expression of words with `and`, `or`, `not` and parentheses; `not` comes first, `or` last. A word stands for the
/// scenarios that have it in their names or as a tag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Choice {
    Word(String),
    Not(Box<Self>),
    And(Box<Self>, Box<Self>),
    Or(Box<Self>, Box<Self>),
}

impl Choice {
    /// Whether a scenario with this name and these tags is chosen.
    pub(crate) fn holds(&self, name: &str, tags: &[String]) -> bool {
        match self {
            Self::Word(word) => name.contains(word) || tags.contains(word),
            Self::Not(inner) => !inner.holds(name, tags),
            Self::And(a, b) => a.holds(name, tags) && b.holds(name, tags),
            Self::Or(a, b) => a.holds(name, tags) || b.holds(name, tags),
        }
    }
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST {
            return Err(format!("write at most {LONGEST} characters"));
        }
        let spaced = text.replace('(', " ( ").replace(')', " ) ");
        let mut tokens = Tokens(spaced.split_whitespace().collect());
        let choice = tokens.alternatives()?;
        match tokens.0.first() {
            None => Ok(choice),
            Some(more) => Err(format!("'{more}' does not follow: join words by and, or")),
        }
    }
}

/// The tokens that are not read yet.
struct Tokens<'a>(Vec<&'a str>);

impl Tokens<'_> {
    fn alternatives(&mut self) -> Result<Choice, String> {
        let mut choice = self.conjunction()?;
        while self.accept("or") {
            choice = Choice::Or(Box::new(choice), Box::new(self.conjunction()?));
        }
        Ok(choice)
    }

    fn conjunction(&mut self) -> Result<Choice, String> {
        let mut choice = self.operand()?;
        while self.accept("and") {
            choice = Choice::And(Box::new(choice), Box::new(self.operand()?));
        }
        Ok(choice)
    }

    fn operand(&mut self) -> Result<Choice, String> {
        if self.accept("not") {
            return Ok(Choice::Not(Box::new(self.operand()?)));
        }
        if self.accept("(") {
            let inner = self.alternatives()?;
            return if self.accept(")") { Ok(inner) } else { Err("a parenthesis is not closed".to_owned()) };
        }
        match self.0.first().copied() {
            Some("and" | "or" | ")") | None => {
                Err("a word is missing, such as in: encoder and not slow".to_owned())
            }
            Some(word) => {
                self.0.remove(0);
                Ok(Choice::Word(word.to_owned()))
            }
        }
    }

    /// Takes the next token if it is this one.
    fn accept(&mut self, token: &str) -> bool {
        let is_next = self.0.first() == Some(&token);
        if is_next {
            self.0.remove(0);
        }
        is_next
    }
}

/// One of several shares of a suite, each for a machine of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shard {
    /// From 1.
    pub(crate) number: usize,
    pub(crate) of: usize,
}

impl Shard {
    /// Whether the scenario at this place of the suite, from 0, belongs to the share.
    pub(crate) fn has(self, place: usize) -> bool {
        place % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("give such as 2/5, the second of five shares".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_of_names_and_tags_and_operators_have_their_order() {
        let tags = ["slow".to_owned(), "bus".to_owned()];
        for (text, holds) in [
            ("encoder", true),
            ("slow", true),
            ("slo", false),
            ("not slow", false),
            ("encoder and not slow", false),
            ("encoder and slow or push", true),
            ("push or encoder and slow", true),
            ("(push or encoder) and not (slow and push)", true),
            ("not push and not jam", true),
            ("not not bus", true),
        ] {
            assert_eq!(text.parse::<Choice>().unwrap().holds("encoder_stuck", &tags), holds, "{text}");
        }
    }

    #[test]
    fn what_is_no_expression_is_refused() {
        for (text, expected) in [
            ("", "a word is missing"),
            ("encoder and", "a word is missing"),
            ("or encoder", "a word is missing"),
            ("(encoder", "not closed"),
            ("encoder)", "')' does not follow"),
            ("encoder slow", "'slow' does not follow"),
            (&"(".repeat(2000), "at most 1000"),
        ] {
            assert!(text.parse::<Choice>().unwrap_err().contains(expected), "{text}");
        }
    }

    #[test]
    fn shards_share_a_suite_without_rest() {
        let shards: Vec<Shard> = ["1/3", "2/3", "3/3"].iter().map(|text| text.parse().unwrap()).collect();
        assert!((0..10).all(|place| shards.iter().filter(|shard| shard.has(place)).count() == 1));
        for text in ["0/3", "4/3", "1", "1/0", "a/b", "1/-1", ""] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
