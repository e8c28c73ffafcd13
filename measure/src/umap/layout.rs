//! The layout: attraction along the edges of the graph, repulsion from points drawn at random.
//!
//! Stochastic gradient descent as in the paper's algorithm 5, arranged so that the result does not depend on how many
//! threads run it. Every edge acts twice in an epoch, as in the reference: each time both its ends move by the same
//! force, and one of them is also repelled. An epoch is cut into rounds; each edge belongs to two of them (a hash
//! says which). A round reads the positions the last one left and writes new ones: every vertex *gathers* the moves
//! due to its own edges of that round, one after the other, everyone else standing still. A vertex has few edges in a round,
//! so this comes close to moving one edge at a time. Its random draws come from a counter of its own.

#![allow(unsafe_code, reason = "wider instructions are called once the processor is known to have them")]

use rayon::prelude::*;

use super::curve::Curve;
use super::fuzzy::FuzzyGraph;
use super::lanes::{Forces, Lanes, Position};
use crate::neighbours::Neighbours;

/// Rounds in an epoch. Fewer let too many edges of a vertex act on outdated positions, which costs quality.
const ROUNDS: usize = 8;
/// Vertices handed to a thread at once.
const CHUNK: usize = 256;

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
    /// In which share of the epochs it acts, its weight over the largest, in units of 2^-32; the last bit says instead whether this end is repelled as well.
    share: u32,
}

impl Edge {
    fn new(target: u32, share: f32, repels: bool) -> Self {
        // A cast from a float stays within the integer's range.
        let share = (f64::from(share) * 2.0_f64.powi(32)) as u32;
        Self { target, share: share & !1 | u32::from(repels) }
    }

    #[inline(always)]
    fn repels(self) -> bool {
        self.share & 1 == 1
    }

    /// Whether it acts in an epoch: when `share · epochs` passes a whole number. Its turns are evenly spaced.
    #[inline(always)]
    fn acts(self, epoch: usize) -> bool {
        let share = self.share & !1;
        share.wrapping_mul(epoch as u32 + 1) < share
    }
}

/// The edges sorted by round, then vertex, as they are walked along: those of vertex `v` in round `r` start at `offsets[r · vertices + v]`.
struct Rounds {
    vertices: usize,
    offsets: Vec<usize>,
    edges: Vec<Edge>,
}

impl Rounds {
    fn new(graph: &FuzzyGraph) -> Self {
        let largest = graph.weights.iter().copied().fold(0.0, f32::max);
        let vertices = graph.vertices();
        let mut offsets = Vec::with_capacity(vertices * ROUNDS + 1);
        let mut edges = Vec::with_capacity(2 * graph.targets.len());
        for round in 0..ROUNDS {
            for vertex in 0..vertices as u32 {
                offsets.push(edges.len());
                edges.extend(graph.edges(vertex as usize).filter_map(|(target, weight)| {
                    let is_first = round == first_round(vertex, target);
                    let is_second = round == (first_round(vertex, target) + ROUNDS / 2) % ROUNDS;
                    let repels = if is_first { vertex < target } else { vertex > target };
                    (is_first || is_second).then(|| Edge::new(target, weight / largest, repels))
                }));
            }
        }
        offsets.push(edges.len());
        Self { vertices, offsets, edges }
    }

    #[inline(always)]
    fn edges(&self, vertex: usize, round: usize) -> &[Edge] {
        let at = round * self.vertices + vertex;
        &self.edges[self.offsets[at]..self.offsets[at + 1]]
    }
}

/// The first of an edge's two rounds, of which both its ends know.
fn first_round(vertex: u32, target: u32) -> usize {
    let (low, high) = (u64::from(vertex.min(target)), u64::from(vertex.max(target)));
    (mix(low << 32 | high) % ROUNDS as u64) as usize
}

impl Descent {
    /// Lay out all vertices of a graph.
    pub(super) fn run(self, graph: &FuzzyGraph, positions: &mut Vec<Position>) {
        let (rounds, forces) = (Rounds::new(graph), Forces::new(self.curve));
        let mut next = positions.clone();
        // Led by a thread of the pool: one outside would wait for it to wake up in each of thousands of short rounds.
        rayon::scope(|_| {
            for epoch in 0..self.epochs {
                for round in 0..ROUNDS {
                    let turn = Turn { descent: self, epoch, forces, all: positions };
                    next.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, moved)| {
                        turn.gather_chunk(&rounds, round, chunk * CHUNK, moved);
                    });
                    std::mem::swap(positions, &mut next);
                }
            }
        });
    }

    /// Lay out new points `placed` against old ones, which stand still. `shares` `[new, k]`: how often each edge acts.
    pub(super) fn place(self, neighbours: &Neighbours, shares: &[f32], old: &[Position], placed: &mut [Position]) {
        let (k, forces) = (neighbours.k(), Forces::new(self.curve));
        placed.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(query, position)| {
            let near = neighbours.rows(query).iter().zip(&shares[query * k..(query + 1) * k]);
            let edges: Vec<Edge> = near.map(|(&target, &share)| Edge::new(target, share, true)).collect();
            for epoch in 0..self.epochs {
                let turn = Turn { descent: self, epoch, forces, all: old };
                *position = turn.gather(usize::MAX, *position, &edges, Draws::new(self.seed, epoch, query));
            }
        });
    }
}

/// One turn of moving vertices, while everyone else stands still.
#[derive(Clone, Copy)]
struct Turn<'a> {
    descent: Descent,
    epoch: usize,
    forces: Forces,
    all: &'a [Position],
}

impl Turn<'_> {
    /// The vertices from `first` on, as many as `moved`, move along their edges of a round. Wide instructions give the same bits as narrow ones.
    fn gather_chunk(&self, rounds: &Rounds, round: usize, first: usize, moved: &mut [Position]) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function asks for.
            return unsafe { self.gather_chunk_avx2(rounds, round, first, moved) };
        }
        self.gather_chunk_portable(rounds, round, first, moved);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn gather_chunk_avx2(&self, rounds: &Rounds, round: usize, first: usize, moved: &mut [Position]) {
        self.gather_chunk_portable(rounds, round, first, moved);
    }

    #[inline(always)]
    fn gather_chunk_portable(&self, rounds: &Rounds, round: usize, first: usize, moved: &mut [Position]) {
        for (vertex, position) in (first..).zip(moved) {
            let draws = Draws::new(self.descent.seed, self.epoch * ROUNDS + round, vertex);
            *position = self.gather(vertex, self.all[vertex], rounds.edges(vertex, round), draws);
        }
    }

    /// One vertex's position after its edges have acted on it.
    #[inline(always)]
    fn gather(&self, vertex: usize, mut at: Position, edges: &[Edge], mut draws: Draws) -> Position {
        let descent = &self.descent;
        let rate = descent.rate * (1.0 - self.epoch as f32 / descent.epochs as f32);
        let mut lanes = Lanes::default();
        for edge in edges.iter().filter(|edge| edge.acts(self.epoch)) {
            if !lanes.may_attract() || (edge.repels() && !lanes.repels_nothing()) {
                at = lanes.act(at, &self.forces, rate);
            }
            lanes.attract(at, self.all[edge.target as usize]);
            for _ in 0..if edge.repels() { descent.negative_samples } else { 0 } {
                if !lanes.may_repel() {
                    at = lanes.act(at, &self.forces, rate);
                }
                let sample = draws.below(self.all.len());
                // A point does not repel itself.
                if sample != vertex {
                    lanes.repel(at, self.all[sample]);
                }
            }
        }
        if lanes.is_empty() { at } else { lanes.act(at, &self.forces, rate) }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// On a processor without wide instructions both are the same function.
    #[test]
    fn wide_instructions_give_the_bits_of_narrow_ones() {
        let vertices = 300;
        let around = |vertex: usize| (1..8).map(move |step| (vertex * 7 + step * step) % 300);
        let edges: Vec<Edge> = (0..vertices)
            .flat_map(|vertex| {
                around(vertex).map(move |target| Edge::new(target as u32, 0.9, (vertex + target) % 3 > 0))
            })
            .collect();
        let rounds = Rounds { vertices, offsets: (0..=vertices).map(|vertex| vertex * 7).collect(), edges };
        let mut draws = Draws::new(3, 0, 0);
        let mut at = || draws.below(10_000) as f32 * 1e-3;
        let all: Vec<Position> = (0..vertices).map(|_| [at(), at()]).collect();
        let curve = Curve::fit(0.1, 1.0);
        let descent = Descent { curve, epochs: 10, rate: 1.0, negative_samples: 7, seed: 5 };
        let turn = Turn { descent, epoch: 3, forces: Forces::new(curve), all: &all };
        let (mut wide, mut narrow) = (all.clone(), all.clone());
        turn.gather_chunk(&rounds, 0, 0, &mut wide);
        turn.gather_chunk_portable(&rounds, 0, 0, &mut narrow);
        assert_eq!(wide, narrow);
        let still = wide.iter().zip(&all).filter(|(moved, before)| moved == before).count();
        assert!(still < 30 && wide.iter().flatten().all(|x| x.is_finite()), "{still} of {vertices} do not move");
    }
}
