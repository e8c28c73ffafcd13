//! One thread with its environments: it is sent orders, and answers each with the rows of its environments.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use vibes_env::videos::VideoLibrary;

use super::options::WorldOptions;
use super::rows::Rows;
use super::slot::{EpisodeKey, Slot};
use crate::error::guarded;
use crate::keeper::Keeper;

/// What a thread is asked to do with its environments.
#[derive(Debug)]
pub(super) enum Order {
    /// Begin an episode in each environment that has a key.
    Reset { keys: Vec<Option<EpisodeKey>>, draw: bool },
    /// One agent step, or the next episode where there is a key. Actions `[environments, action]`.
    Step { actions: Vec<f32>, keys: Vec<Option<EpisodeKey>>, draw: bool },
    /// Draw the present row.
    Look,
    /// Put finished episodes into a recording, or no longer.
    Keep(Option<Keeper>),
    /// Play random actions.
    Roll { steps: u32, draw: bool },
}

/// The thread, from outside.
#[derive(Debug)]
pub(super) struct Worker {
    environments: usize,
    orders: Option<Sender<Order>>,
    answers: Receiver<Result<Rows, String>>,
    thread: Option<JoinHandle<()>>,
}

const GONE: &str = "a thread of this environment has ended; make another environment";

impl Worker {
    /// Starts a thread and waits until its environments are open.
    pub(super) fn start(
        environments: usize,
        options: &WorldOptions,
        videos: &Arc<VideoLibrary>,
    ) -> Result<Self, String> {
        let (orders, received) = channel();
        let (answer, answers) = channel();
        let (options, videos) = (options.clone(), videos.clone());
        let work = move || {
            let open = || (0..environments).map(|_| Slot::open(&options, &videos)).collect::<Result<Vec<_>, _>>();
            match guarded(open) {
                Ok(slots) => {
                    // Whoever waits for the first answer waits for this one.
                    if answer.send(Ok(Rows::default())).is_ok() {
                        obey(slots, &received, &answer);
                    }
                }
                // Nobody to tell is nobody who waits.
                Err(refusal) => drop(answer.send(Err(refusal))),
            }
        };
        let thread = std::thread::Builder::new().name("vibes".to_owned()).spawn(work);
        let thread = thread.map_err(|error| format!("no thread for the environments: {error}"))?;
        let worker = Self { environments, orders: Some(orders), answers, thread: Some(thread) };
        worker.answer()?;
        Ok(worker)
    }

    /// How many environments it has.
    pub(super) fn environments(&self) -> usize {
        self.environments
    }

    pub(super) fn send(&self, order: Order) -> Result<(), String> {
        let orders = self.orders.as_ref().ok_or(GONE)?;
        orders.send(order).map_err(|_gone| GONE.to_owned())
    }

    pub(super) fn answer(&self) -> Result<Rows, String> {
        self.answers.recv().unwrap_or_else(|_gone| Err(GONE.to_owned()))
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Without a sender the thread's loop ends.
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so in its last answer.
            let _ = thread.join();
        }
    }
}

fn obey(mut slots: Vec<Slot>, orders: &Receiver<Order>, answers: &Sender<Result<Rows, String>>) {
    for order in orders {
        let rows = guarded(|| carry_out(&mut slots, order));
        if answers.send(rows).is_err() {
            return;
        }
    }
}

fn carry_out(slots: &mut [Slot], order: Order) -> Result<Rows, String> {
    let mut rows = Rows::default();
    match order {
        Order::Reset { keys, draw } => {
            for (slot, key) in slots.iter_mut().zip(keys) {
                if let Some(key) = key {
                    slot.begin(key)?;
                }
                slot.show(draw, 0.0, &mut rows)?;
            }
        }
        Order::Step { actions, keys, draw } => {
            let width = actions.len() / slots.len().max(1);
            for ((slot, key), action) in slots.iter_mut().zip(keys).zip(actions.chunks_exact(width.max(1))) {
                let reward = match key {
                    Some(key) => slot.begin(key).map(|()| 0.0)?,
                    None => slot.step(action)?,
                };
                slot.show(draw, reward, &mut rows)?;
            }
        }
        Order::Look => slots.iter_mut().try_for_each(|slot| slot.show(true, 0.0, &mut rows))?,
        Order::Keep(keeper) => slots.iter_mut().for_each(|slot| slot.keep(keeper.clone())),
        Order::Roll { steps, draw } => slots.iter_mut().try_for_each(|slot| slot.roll(steps, draw))?,
    }
    Ok(rows)
}
