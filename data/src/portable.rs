//! Paths that are written into files: relative, so that folders can be moved together, and never a path of one machine.

use std::path::{Path, PathBuf};

/// A path as it is written into a file at `beside`: as it stands if it is relative and beneath the current folder, else from the deepest folder that
/// both lie in. Whoever reads it looks below every folder above the file.
pub fn portable(path: &Path, beside: &Path) -> String {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let (whole, other) = (absolute(path), absolute(beside));
    if let Ok(below) = whole.strip_prefix(absolute(Path::new("."))) {
        return text(below);
    }
    let shared: PathBuf = whole.iter().zip(other.iter()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect();
    if shared.parent().is_some() {
        return text(whole.strip_prefix(&shared).unwrap_or(&whole));
    }
    // Nothing in common but the root: the last two names say what it was.
    let names: Vec<_> = whole.iter().rev().take(2).collect();
    text(&names.into_iter().rev().collect::<PathBuf>())
}

fn text(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_in_a_file_is_absolute() {
        let of = |path: &str, beside: &str| portable(Path::new(path), Path::new(beside));
        assert_eq!(of("recordings/x", "runs/a/latents.arrow"), "recordings/x");
        assert_eq!(of("/data/recordings/x", "/data/runs/a/latents.arrow"), "recordings/x");
        assert_eq!(of("/data/runs/a/latents.arrow", "/data/runs/a/figures/map.arrow"), "latents.arrow");
        assert_eq!(of("/data/recordings/x", "/else/where"), "recordings/x");
        let here = std::path::absolute("recordings/x").unwrap_or_default();
        assert_eq!(portable(&here, Path::new("/else/where")), "recordings/x");
    }
}
