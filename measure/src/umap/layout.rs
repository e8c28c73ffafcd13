//! The layout: attraction along the edges of the graph, repulsion from points drawn at random.
//!
//! Stochastic gradient descent as in the paper's algorithm 5, arranged so that the result does not depend on how many
//! threads run it. Every edge acts twice in an epoch, as in the reference: each time both its ends move by the same
//! force, and one of them is also repelled. An epoch is cut into rounds; each edge belongs to two of them (a hash
//! says which). A round reads the positions the last one left and writes new ones: every vertex *gathers* the moves
//! due to its own edges of that round, one after the other, everyone else standing still. A vertex has few edges in a round,
//! so this comes close to moving one edge at a time. Its random draws come from a counter of its own.

use rayon::prelude::*;

use super::curve::{Curve, Forces, LANES};
use super::fuzzy::FuzzyGraph;
use crate::neighbours::Neighbours;

/// A point of the map.
pub type Position = [f32; 2];

/// Rounds in an epoch. Fewer let too many edges of a vertex act on outdated positions, which costs quality.
const ROUNDS: usize = 8;
/// Vertices handed to a thread at once.
const CHUNK: usize = 256;
/// No single move is longer than this times the learning rate, per coordinate.
const LONGEST: f32 = 4.0;

/// What the descent needs besides graph and positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Descent {
    pub curve: Curve,
    pub epochs: usize,
    /// Learning rate of the first epoch; falls linearly to 0.
    pub rate: f32,
    /// Random points that repel, for each attraction.
    pub negative_samples: usize,
    pub seed: u64,
}

/// One end's view of an edge in a round.
#[derive(Debug, Clone, Copy)]
struct Edge {
    target: u32,
    /// In which share of the epochs it acts, its weight over the largest: in units of 2^-32.
    share: u32,
    /// Whether this end is repelled as well.
    repels: bool,
}

impl Edge {
    fn new(target: u32, share: f32, repels: bool) -> Self {
        // A cast from a float stays within the integer's range.
        Self { target, share: (f64::from(share) * 2.0_f64.powi(32)) as u32, repels }
    }

    /// Whether it acts in an epoch: when `share · epochs` passes a whole number. Its turns are evenly spaced.
    #[inline]
    fn acts(self, epoch: usize) -> bool {
        self.share.wrapping_mul(epoch as u32 + 1) < self.share
    }
}

/// The edges sorted by vertex, then round: those of vertex `v` in round `r` start at `offsets[v · ROUNDS + r]`.
struct Rounds {
    offsets: Vec<usize>,
    edges: Vec<Edge>,
}

impl Rounds {
    fn new(graph: &FuzzyGraph) -> Self {
        let largest = graph.weights.iter().copied().fold(0.0, f32::max);
        let mut offsets = Vec::with_capacity(graph.vertices() * ROUNDS + 1);
        let mut edges = Vec::with_capacity(2 * graph.targets.len());
        for vertex in 0..graph.vertices() as u32 {
            let mut by_round: [Vec<Edge>; ROUNDS] = Default::default();
            for (target, weight) in graph.edges(vertex as usize) {
                // Both ends must agree on the rounds.
                let (low, high) = (u64::from(vertex.min(target)), u64::from(vertex.max(target)));
                let first = (mix(low << 32 | high) % ROUNDS as u64) as usize;
                let second = (first + ROUNDS / 2) % ROUNDS;
                let share = weight / largest;
                by_round[first].push(Edge::new(target, share, vertex < target));
                by_round[second].push(Edge::new(target, share, vertex > target));
            }
            for round in by_round {
                offsets.push(edges.len());
                edges.extend(round);
            }
        }
        offsets.push(edges.len());
        Self { offsets, edges }
    }

    fn edges(&self, vertex: usize, round: usize) -> &[Edge] {
        let at = vertex * ROUNDS + round;
        &self.edges[self.offsets[at]..self.offsets[at + 1]]
    }
}

impl Descent {
    /// Lay out all vertices of a graph.
    pub(super) fn run(self, graph: &FuzzyGraph, positions: &mut Vec<Position>) {
        let rounds = Rounds::new(graph);
        let mut next = positions.clone();
        for epoch in 0..self.epochs {
            for round in 0..ROUNDS {
                let old = positions.as_slice();
                next.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(vertex, position)| {
                    let draws = Draws::new(self.seed, epoch * ROUNDS + round, vertex);
                    *position = self.gather(epoch, (vertex, old[vertex]), rounds.edges(vertex, round), old, draws);
                });
                std::mem::swap(positions, &mut next);
            }
        }
    }

    /// Lay out new points `placed` against old ones, which stand still. `shares` `[new, k]`: how often each edge acts.
    pub(super) fn place(self, neighbours: &Neighbours, shares: &[f32], old: &[Position], placed: &mut [Position]) {
        let k = neighbours.k();
        placed.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(query, position)| {
            let near = neighbours.rows(query).iter().zip(&shares[query * k..(query + 1) * k]);
            let edges: Vec<Edge> = near.map(|(&target, &share)| Edge::new(target, share, true)).collect();
            for epoch in 0..self.epochs {
                let draws = Draws::new(self.seed, epoch, query);
                *position = self.gather(epoch, (usize::MAX, *position), &edges, old, draws);
            }
        });
    }

    /// One vertex's position after its edges have acted on it.
    fn gather(
        self,
        epoch: usize,
        (vertex, start): (usize, Position),
        edges: &[Edge],
        all: &[Position],
        mut draws: Draws,
    ) -> Position {
        let rate = self.rate * (1.0 - epoch as f32 / self.epochs as f32);
        let mut at = start;
        for edge in edges.iter().filter(|edge| edge.acts(epoch)) {
            let other = all[edge.target as usize];
            if !edge.repels {
                at = moved(at, &[other], &self.curve.attraction(), rate);
                continue;
            }
            // The attraction and the first repulsions share one pass over the lanes.
            let mut others = [at; LANES];
            others[0] = other;
            let mut forces = self.curve.attraction_and_repulsions();
            let mut lane = 1;
            for _ in 0..self.negative_samples {
                if lane == LANES {
                    at = moved(at, &others, &forces, rate);
                    (others, forces, lane) = ([at; LANES], self.curve.repulsions(), 0);
                }
                let sample = draws.below(all.len());
                // A point does not repel itself; a lane that holds `at` exerts no force.
                others[lane] = if sample == vertex { at } else { all[sample] };
                lane += 1;
            }
            at = moved(at, &others, &forces, rate);
        }
        at
    }
}

/// Move `at` by the forces the others exert on it there.
#[inline]
fn moved<const N: usize>(at: Position, others: &[Position; N], forces: &Forces<N>, rate: f32) -> Position {
    let x: [f32; N] = std::array::from_fn(|lane| at[0] - others[lane][0]);
    let y: [f32; N] = std::array::from_fn(|lane| at[1] - others[lane][1]);
    let force = forces.at(&std::array::from_fn(|lane| x[lane] * x[lane] + y[lane] * y[lane]));
    let sum = |difference: [f32; N]| {
        (0..N).map(|lane| (force[lane] * difference[lane]).clamp(-LONGEST, LONGEST)).sum::<f32>()
    };
    [at[0] + rate * sum(x), at[1] + rate * sum(y)]
}

/// Random numbers of one vertex in one round (`SplitMix64` from a hash of the three).
struct Draws(u64);

impl Draws {
    #[inline]
    fn new(seed: u64, round: usize, vertex: usize) -> Self {
        let counter = ((round as u64) << 40) ^ vertex as u64;
        Self(mix(seed ^ mix(counter.wrapping_mul(0x9e37_79b9_7f4a_7c15))))
    }

    /// Uniform below `end`.
    #[inline]
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (((mix(self.0) >> 32) * end as u64) >> 32) as usize
    }
}

#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
