//! Repulsion from all points at once: a tree of squares, in which a far square acts as one point at its centre of mass.

/// Deepest level: points closer than the extent over 2^DEPTH share a leaf.
const DEPTH: usize = 24;

/// A node: an inner one has four children, a leaf none.
#[derive(Debug, Clone, Copy)]
struct Node {
    centre_of_mass: [f32; 2],
    mass: f32,
    /// Side of the square.
    width: f32,
    /// Index of the first of four consecutive children, 0 for a leaf.
    children: u32,
}

/// The tree over a set of positions.
pub(super) struct Quadtree {
    nodes: Vec<Node>,
}

/// The part of the plane a node stands for, and its points `order[from..to]`.
struct Part {
    node: usize,
    corner: [f32; 2],
    width: f32,
    from: usize,
    to: usize,
    depth: usize,
}

impl Quadtree {
    pub(super) fn new(positions: &[[f32; 2]]) -> Self {
        let low = |axis: usize| positions.iter().map(|at| at[axis]).fold(f32::INFINITY, f32::min);
        let high = |axis: usize| positions.iter().map(|at| at[axis]).fold(f32::NEG_INFINITY, f32::max);
        let corner = [low(0), low(1)];
        let width = (high(0) - corner[0]).max(high(1) - corner[1]);
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        let mut nodes = vec![leaf(width)];
        let mut parts = vec![Part { node: 0, corner, width, from: 0, to: positions.len(), depth: 0 }];
        while let Some(part) = parts.pop() {
            let members = &mut order[part.from..part.to];
            let count = members.len() as f32;
            let mean = |axis: usize| {
                (members.iter().map(|&at| f64::from(positions[at as usize][axis])).sum::<f64>() / f64::from(count))
                    as f32
            };
            nodes[part.node].mass = count;
            nodes[part.node].centre_of_mass = if members.is_empty() { [0.0; 2] } else { [mean(0), mean(1)] };
            if members.len() < 2 || part.depth == DEPTH {
                continue;
            }
            let half = part.width / 2.0;
            let middle = [part.corner[0] + half, part.corner[1] + half];
            let quarter = |at: u32| {
                let at = positions[at as usize];
                usize::from(at[0] >= middle[0]) + 2 * usize::from(at[1] >= middle[1])
            };
            members.sort_by_key(|&at| quarter(at));
            let first = nodes.len();
            nodes[part.node].children = first as u32;
            let mut from = part.from;
            for child in 0..4 {
                let to = part.from + order[part.from..part.to].partition_point(|&at| quarter(at) <= child);
                let corner = [part.corner[0] + half * (child % 2) as f32, part.corner[1] + half * (child / 2) as f32];
                nodes.push(leaf(half));
                parts.push(Part { node: first + child, corner, width: half, from, to, depth: part.depth + 1 });
                from = to;
            }
        }
        Self { nodes }
    }

    /// `Σ_j w² (y - y_j)` and `Σ_j w` with `w = 1 / (1 + |y - y_j|²)`, over all points but the one at `y` itself.
    pub(super) fn repulsion(&self, at: [f32; 2], theta: f32) -> ([f32; 2], f32) {
        let (mut force, mut total) = ([0.0_f32; 2], 0.0_f32);
        let mut stack = [0_u32; 4 * DEPTH + 4];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = &self.nodes[stack[height] as usize];
            if node.mass == 0.0 {
                continue;
            }
            let difference = [at[0] - node.centre_of_mass[0], at[1] - node.centre_of_mass[1]];
            let squared = difference[0] * difference[0] + difference[1] * difference[1];
            let far = node.width * node.width < theta * theta * squared;
            if node.children == 0 || far {
                let weight = 1.0 / (1.0 + squared);
                // The point itself is in the leaf it coincides with, and adds 1 to the total and nothing to the force.
                total += node.mass * weight;
                let push = node.mass * weight * weight;
                force = [force[0] + push * difference[0], force[1] + push * difference[1]];
            } else {
                for child in 0..4 {
                    stack[height] = node.children + child;
                    height += 1;
                }
            }
        }
        (force, total - 1.0)
    }
}

fn leaf(width: f32) -> Node {
    Node { centre_of_mass: [0.0; 2], mass: 0.0, width, children: 0 }
}
