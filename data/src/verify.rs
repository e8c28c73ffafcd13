//! Checks what can be checked without a simulator: every file's checksum, the columns and their alignment, and that the
//! MCAP log tells the same episode as the Arrow table. In: a recording. Out: what is wrong, one finding a file.

use std::path::Path;

use crate::{
    BackgroundFrame, EpisodeEntry, Error, FileEntry, Finding, Recording, Result, Spec, read_episode_entry, read_mcap,
    sha256_hex,
};

/// Checks every episode of a recording, one at a time, and names the files that are none.
pub fn verify_recording(recording: &Recording) -> Vec<Finding> {
    let check = |entry| verify_episode(recording, entry);
    let strays = recording.strays().iter().cloned().chain(recording.unlisted_logs(false));
    recording.episodes().iter().flat_map(check).chain(strays).collect()
}

/// Checks the files of one episode.
pub fn verify_episode(recording: &Recording, entry: &EpisodeEntry) -> Vec<Finding> {
    let files = [Some(&entry.arrow), entry.mcap.as_ref()];
    let mut findings: Vec<Finding> =
        files.into_iter().flatten().filter_map(|file| check_file(recording.path(), file).err()).collect();
    if findings.is_empty() {
        let compared = compare(recording, entry, &recording.manifest().spec);
        let path = recording.path().join(&entry.arrow.path);
        findings.extend(compared.err().map(|fault| Finding { path, fault: fault.to_string() }));
    }
    findings
}

/// That a file of the recording in `folder` is what was written, to the byte. Whoever writes again what it holds has to ask first: what comes out has a checksum of its own.
///
/// # Errors
/// A [`Finding`] for a file that cannot be read, or has another size or checksum than its entry.
pub fn check_file(folder: &Path, file: &FileEntry) -> std::result::Result<(), Finding> {
    let path = folder.join(&file.path);
    let contents = match std::fs::metadata(&path) {
        // Reading a pipe waits for its writer.
        Ok(found) if !found.is_file() => Err(std::io::Error::other("it is no file")),
        _ => std::fs::read(&path),
    };
    let fault = match contents {
        Err(error) => format!("cannot be read: {error}"),
        Ok(contents) if contents.len() as u64 != file.bytes => {
            format!("{} bytes, the manifest says {}", contents.len(), file.bytes)
        }
        Ok(contents) if sha256_hex(&contents) != file.sha256 => "its checksum differs from the manifest's".into(),
        Ok(_) => return Ok(()),
    };
    Err(Finding { path, fault })
}

/// Says which part of an episode's own entry differs from the manifest's; only the manifest knows the files.
fn other_entry(own: &EpisodeEntry, listed: &EpisodeEntry) -> Option<String> {
    let text = |entry: &EpisodeEntry| -> serde_json::Map<String, serde_json::Value> {
        match serde_json::to_value(entry) {
            Ok(serde_json::Value::Object(map)) => map,
            _ => serde_json::Map::new(),
        }
    };
    let (own, listed) = (text(own), text(listed));
    let differs =
        listed.iter().find(|(key, value)| !["arrow", "mcap"].contains(&key.as_str()) && own.get(*key) != Some(value));
    differs.map(|(key, value)| {
        format!("its own {key} is {}, the manifest's {value}", own.get(key).cloned().unwrap_or_default())
    })
}

fn compare(recording: &Recording, entry: &EpisodeEntry, spec: &Spec) -> Result<()> {
    let episode = recording.episode(entry.index)?.to_episode();
    episode.check(spec)?;
    let path = recording.path().join(&entry.arrow.path);
    if let Some(fact) = other_entry(&read_episode_entry(&path)?, entry) {
        return Err(Error::malformed(path, fact, "the same entry in the file and in the manifest"));
    }
    let total = episode.episode_return();
    let is_the_sum = (total - entry.episode_return).abs() <= 1e-6 * total.abs().max(1.0);
    if !is_the_sum {
        let expected = format!("{} as the manifest says", entry.episode_return);
        return Err(Error::malformed(path, format!("rewards sum to {total}"), expected));
    }
    let videos = &recording.manifest().videos;
    let outside = |shown: &&BackgroundFrame| videos.get(shown.video as usize).is_none_or(|v| shown.frame >= v.frames);
    if let Some(shown) = episode.backgrounds.iter().flatten().find(outside) {
        let fact = format!("frame {} of video {}", shown.frame, shown.video);
        return Err(Error::malformed(path, fact, format!("one of the manifest's {} videos", videos.len())));
    }
    match &entry.mcap {
        Some(file) if !read_mcap(&recording.path().join(&file.path), spec)?.same_bits(&episode) => {
            Err(Error::malformed(path, "the MCAP log holds another episode", "the same rows in both files"))
        }
        _ => Ok(()),
    }
}
