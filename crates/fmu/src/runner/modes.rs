//! Values in a discrete state on which equations may branch.

use crate::combinations::MOST_VALUES;
use crate::discrete_state::{DiscreteState, Word, Words};

/// Booleans and enumerations in a discrete state: the position of each among the fields, and its values. Integers are
/// left out, because they may be counts or indices, and the equations need not be valid for all their values.
#[derive(Debug, Default)]
pub struct Modes(Vec<(usize, Vec<u64>)>);

impl Modes {
    pub(super) fn of<D: DiscreteState + Clone>(discrete: &D) -> Self {
        let words = words(discrete);
        let is_possible = |at: usize, value: u64| with(discrete, words.clone(), &[(at, value)]).is_some();
        let values = |at: usize| (0..MOST_VALUES as u64).filter(|&value| is_possible(at, value)).collect::<Vec<_>>();
        let choices = (0..words.len()).filter(|&at| Words(&words[at]).choice("").is_ok());
        Self(choices.map(|at| (at, values(at))).filter(|(_, values)| !values.is_empty()).collect())
    }

    /// The number of values for each field.
    pub(crate) fn sizes(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|(_, values)| values.len())
    }

    /// The discrete state with values chosen by index. `None` if the values exclude each other.
    pub(super) fn with<D: DiscreteState + Clone>(&self, discrete: &D, numbers: &[Option<usize>]) -> Option<D> {
        let chosen = self.0.iter().zip(numbers).filter_map(|((at, values), number)| Some((*at, values[(*number)?])));
        with(discrete, words(discrete), &chosen.collect::<Vec<_>>())
    }
}

fn words<D: DiscreteState>(discrete: &D) -> Vec<Vec<u8>> {
    let mut words = Vec::new();
    discrete.save(&mut |word| words.push(bytes(word)));
    words
}

fn bytes(word: Word<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    word.write(&mut bytes);
    bytes
}

fn with<D: DiscreteState + Clone>(discrete: &D, mut words: Vec<Vec<u8>>, changes: &[(usize, u64)]) -> Option<D> {
    for &(at, value) in changes {
        words[at] = bytes(Word::Choice(value));
    }
    let mut state = discrete.clone();
    state.load(&mut Words(&words.concat())).ok().map(|()| state)
}
