//! The parser, from text to a tree: precedence climbing (Pratt 1973, Top down operator precedence).
//!
//! `+ -`, then `* /`, then the sign, then `^` (or `**`) from the right; functions of one argument,
//! `min` and `max` of two.

use super::tree::{Function, Operator, Tree, Variable};

/// The longest term, in characters.
const LONGEST: usize = 1000;
/// The deepest nesting of brackets; what is in one and its sign are a level each.
const DEEPEST: usize = 60;
/// The largest tree: `min` and `max` use each of their arguments twice.
const LARGEST: usize = 4000;

const VARIABLES: [(&str, Variable); 6] = [
    ("theta", Variable::Theta),
    ("v", Variable::Velocity),
    ("phase", Variable::Phase),
    ("t", Variable::Lab),
    ("w0", Variable::Frequency),
    ("a", Variable::Pivot),
];
const FUNCTIONS: [(&str, Function); 9] = [
    ("sqrt", Function::Root),
    ("exp", Function::Exponential),
    ("log", Function::Logarithm),
    ("sin", Function::Sine),
    ("cos", Function::Cosine),
    ("tanh", Function::Tanh),
    ("wrap", Function::Wrap),
    ("abs", Function::Abs),
    ("sign", Function::Sign),
];
const CONSTANT: &str = "pi";
const OF_TWO: [&str; 2] = ["min", "max"];

/// Whether a parameter may not have this name.
pub fn is_taken(name: &str) -> bool {
    let variable = VARIABLES.iter().any(|(known, _)| *known == name);
    let function = FUNCTIONS.iter().any(|(known, _)| *known == name);
    variable || function || name == CONSTANT || OF_TWO.contains(&name)
}

/// The tree of `text`, with `parameters` as further names.
///
/// # Errors
/// A message: the error, its place (in characters from 1), and the text expected there.
pub fn parse(text: &str, parameters: &[String]) -> Result<Tree, String> {
    let characters: Vec<char> = text.chars().collect();
    if characters.len() > LONGEST {
        let count = characters.len();
        return Err(format!("must have at most {LONGEST} characters, got {count}"));
    }
    let tokens = tokens(&characters)?;
    let mut parser = Parser { tokens, next: 0, depth: 0, parameters };
    let tree = parser.sum(0)?;
    match parser.peek() {
        Token::End => Ok(tree),
        other => Err(parser.unexpected(&other, "an operator or the end")),
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Name(String),
    /// An operator, a bracket or a comma.
    Mark(char),
    End,
}

fn tokens(characters: &[char]) -> Result<Vec<(Token, usize)>, String> {
    let mut found = Vec::new();
    let mut i = 0;
    while i < characters.len() {
        let (c, begin) = (characters[i], i);
        let run = |from: usize, goes_on: fn(char) -> bool| {
            from + characters[from..].iter().take_while(|c| goes_on(**c)).count()
        };
        if c.is_whitespace() {
            i += 1;
            continue;
        }
        let token = if c.is_ascii_digit() || c == '.' {
            i = run(i, |c| c.is_ascii_digit() || c == '.');
            if matches!(characters.get(i), Some('e' | 'E')) {
                let sign = usize::from(matches!(characters.get(i + 1), Some('+' | '-')));
                if characters.get(i + 1 + sign).is_some_and(char::is_ascii_digit) {
                    i = run(i + 1 + sign, |c| c.is_ascii_digit());
                }
            }
            let text: String = characters[begin..i].iter().collect();
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Token::Number(value),
                _ => return Err(format!("{text} at {} is not a finite number", begin + 1)),
            }
        } else if c.is_ascii_alphabetic() || c == '_' {
            i = run(i, |c| c.is_ascii_alphanumeric() || c == '_');
            Token::Name(characters[begin..i].iter().collect())
        } else if c == '*' && characters.get(i + 1) == Some(&'*') {
            i += 2;
            Token::Mark('^')
        } else if "+-*/^(),".contains(c) {
            i += 1;
            Token::Mark(c)
        } else {
            let shown = c.escape_debug();
            let known = "numbers, names, + - * / ^ ( ) and commas";
            return Err(format!("unexpected '{shown}' at {}: there must be {known}", begin + 1));
        };
        found.push((token, begin + 1));
    }
    found.push((Token::End, characters.len() + 1));
    Ok(found)
}

struct Parser<'a> {
    tokens: Vec<(Token, usize)>,
    next: usize,
    depth: usize,
    parameters: &'a [String],
}

impl Parser<'_> {
    fn peek(&self) -> Token {
        self.tokens[self.next].0.clone()
    }

    fn place(&self) -> usize {
        self.tokens[self.next].1
    }

    fn take(&mut self) -> Token {
        let token = self.peek();
        if token != Token::End {
            self.next += 1;
        }
        token
    }

    fn unexpected(&self, token: &Token, wanted: &str) -> String {
        let shown = match token {
            Token::End => return format!("ends at {}: there must be {wanted}", self.place()),
            Token::Number(value) => value.to_string(),
            Token::Name(name) => name.clone(),
            Token::Mark(mark) => mark.to_string(),
        };
        format!("unexpected '{shown}' at {}: there must be {wanted}", self.place())
    }

    fn expect(&mut self, mark: char) -> Result<(), String> {
        let token = self.peek();
        if token == Token::Mark(mark) {
            self.next += 1;
            return Ok(());
        }
        Err(self.unexpected(&token, &format!("'{mark}'")))
    }

    /// Sums and products whose operators bind at least as strongly as `least`.
    fn sum(&mut self, least: u8) -> Result<Tree, String> {
        self.depth += 1;
        if self.depth > 2 * DEEPEST {
            let place = self.place();
            return Err(format!(
                "is nested too deeply at {place}: it must have at most {DEEPEST} brackets"
            ));
        }
        let mut left = self.signed()?;
        loop {
            let (operator, strength) = match self.peek() {
                Token::Mark('+') => (Operator::Add, 1),
                Token::Mark('-') => (Operator::Subtract, 1),
                Token::Mark('*') => (Operator::Multiply, 2),
                Token::Mark('/') => (Operator::Divide, 2),
                _ => break,
            };
            if strength < least {
                break;
            }
            self.next += 1;
            let right = self.sum(strength + 1)?;
            left = Tree::join(operator, left, right);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn signed(&mut self) -> Result<Tree, String> {
        self.depth += 1;
        if self.depth > 2 * DEEPEST {
            let place = self.place();
            return Err(format!(
                "is nested too deeply at {place}: it must have at most {DEEPEST} brackets"
            ));
        }
        let tree = match self.peek() {
            Token::Mark('-') => {
                self.next += 1;
                self.signed()?.negated()
            }
            Token::Mark('+') => {
                self.next += 1;
                self.signed()?
            }
            _ => {
                let base = self.single()?;
                if self.peek() == Token::Mark('^') {
                    self.next += 1;
                    let exponent = self.signed()?;
                    Tree::join(Operator::Power, base, exponent)
                } else {
                    base
                }
            }
        };
        self.depth -= 1;
        Ok(tree)
    }

    fn single(&mut self) -> Result<Tree, String> {
        let place = self.place();
        let token = self.peek();
        match self.take() {
            Token::Number(value) => Ok(Tree::Number(value)),
            Token::Mark('(') => {
                let inner = self.sum(0)?;
                self.expect(')')?;
                Ok(inner)
            }
            Token::Name(name) => self.named(&name, place),
            _ => {
                self.next = self.next.saturating_sub(usize::from(token != Token::End));
                Err(self.unexpected(&token, "a number, a name or a bracket"))
            }
        }
    }

    fn named(&mut self, name: &str, place: usize) -> Result<Tree, String> {
        if self.peek() == Token::Mark('(') {
            return self.called(name, place);
        }
        if let Some(index) = self.parameters.iter().position(|known| known == name) {
            return Ok(Tree::Variable(Variable::Parameter(index)));
        }
        if let Some((_, variable)) = VARIABLES.iter().find(|(known, _)| *known == name) {
            return Ok(Tree::Variable(*variable));
        }
        if name == CONSTANT {
            return Ok(Tree::Number(std::f64::consts::PI));
        }
        if FUNCTIONS.iter().any(|(known, _)| *known == name) || OF_TWO.contains(&name) {
            return Err(format!("'{name}' at {place} is a function: it must be {name}(...)"));
        }
        let mut known: Vec<&str> = VARIABLES.iter().map(|(known, _)| *known).collect();
        known.push(CONSTANT);
        known.extend(self.parameters.iter().map(String::as_str));
        let known = known.join(", ");
        Err(format!("unknown name '{name}' at {place}: it must be one of {known}"))
    }

    fn called(&mut self, name: &str, place: usize) -> Result<Tree, String> {
        let function = FUNCTIONS.iter().find(|(known, _)| *known == name);
        if function.is_none() && !OF_TWO.contains(&name) {
            let known: Vec<&str> =
                FUNCTIONS.iter().map(|(known, _)| *known).chain(OF_TWO).collect();
            let known = known.join(", ");
            return Err(format!("unknown function '{name}' at {place}: it must be one of {known}"));
        }
        self.next += 1;
        let first = self.sum(0)?;
        if let Some((_, function)) = function {
            self.expect(')')?;
            return Ok(Tree::apply(*function, first));
        }
        self.expect(',')?;
        let second = self.sum(0)?;
        self.expect(')')?;
        if 2 * (first.size() + second.size()) > LARGEST {
            return Err(format!("has too many {name}(...) within each other at {place}"));
        }
        // Half the sum, and half the distance off it.
        let sum = Tree::join(Operator::Add, first.clone(), second.clone());
        let apart = Tree::apply(Function::Abs, Tree::join(Operator::Subtract, first, second));
        let side = if name == "max" { Operator::Add } else { Operator::Subtract };
        Ok(Tree::join(Operator::Multiply, Tree::Number(0.5), Tree::join(side, sum, apart)))
    }
}
