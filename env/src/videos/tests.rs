//! Laws of the videos.

use std::collections::BTreeSet;
use std::sync::Mutex;

use super::procedural::{FRAMES, Family, ProceduralVideo};
use super::*;

fn write_video(folder: &Path, name: &str, frames: u8) {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for frame in 0..frames {
        let picture = image::RgbImage::from_pixel(32, 18, image::Rgb([frame * 10, 100, 200]));
        picture.save(folder.join(format!("{frame:05}.png"))).unwrap();
    }
}

#[test]
fn procedural_sets_share_no_family_and_no_name() {
    assert!(Family::of(VideoSet::Train).iter().all(|family| !Family::of(VideoSet::Val).contains(family)));
    let names = |set| procedural::list(set, Some(200)).into_iter().collect::<BTreeSet<_>>();
    let (train, val) = (names(VideoSet::Train), names(VideoSet::Val));
    assert_eq!((train.len(), val.len()), (200, 200));
    assert!(train.is_disjoint(&val));
    assert_eq!((procedural::list(VideoSet::Train, None).len(), procedural::list(VideoSet::Val, None).len()), (60, 30));
}

/// A number from a damaged file asks for more names than memory holds.
#[test]
fn more_videos_than_a_set_may_have_are_refused_before_any_is_named() {
    let most = usize::from(MOST_VIDEOS);
    assert_eq!(VideoSource::Procedural.list(VideoSet::Val, Some(most)).unwrap().len(), most);
    for count in [most + 1, usize::MAX] {
        let error = VideoSource::Procedural.list(VideoSet::Train, Some(count)).unwrap_err().to_string();
        assert!(error.contains(&count.to_string()) && error.contains("1 to 10000"), "{error}");
    }
}

#[test]
fn procedural_videos_depend_on_their_name_only_and_move() {
    for set in [VideoSet::Train, VideoSet::Val] {
        let names = procedural::list(set, Some(6));
        let frame = |name: &str, index| ProceduralVideo::named(name).unwrap().frame(index);
        for name in &names {
            let (first, next, far) = (frame(name, 0), frame(name, 1), frame(name, FRAMES - 1));
            assert_eq!(first, frame(name, 0));
            let (step, way) =
                (crate::render::picture_difference(&first, &next).0, crate::render::picture_difference(&first, &far).0);
            assert!(step > 0.5 && step < way, "{name}: {step} levels a frame, {way} over the video");
        }
        assert_ne!(frame(&names[0], 0), frame(&names[3], 0));
    }
}

/// Natural pictures: colourful, contrasty, and more alike near than far.
#[test]
fn procedural_videos_look_natural() {
    for set in [VideoSet::Train, VideoSet::Val] {
        for name in procedural::list(set, Some(30)) {
            let picture = ProceduralVideo::named(&name).unwrap().frame(10);
            let brightness: Vec<f64> =
                picture.chunks(3).map(|rgb| rgb.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0).collect();
            let mean = brightness.iter().sum::<f64>() / brightness.len() as f64;
            let spread = (brightness.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / brightness.len() as f64).sqrt();
            assert!((30.0..225.0).contains(&mean) && spread > 15.0, "{name}: mean {mean:.0}, spread {spread:.0}");
            let colour = picture
                .chunks(3)
                .map(|rgb| f64::from(rgb.iter().max().unwrap() - rgb.iter().min().unwrap()))
                .sum::<f64>();
            assert!(colour / brightness.len() as f64 > 12.0, "{name} is grey");
            let apart =
                |shift: usize| brightness.iter().zip(&brightness[shift..]).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            assert!(apart(1) < apart(8) && apart(8) < 2.5 * apart(32), "{name}");
        }
    }
}

#[test]
fn an_unknown_procedural_video_is_refused() {
    for name in ["fog-001", "leaves", "leaves-x", ""] {
        assert!(ProceduralVideo::named(name).is_err());
    }
}

#[test]
fn davis_is_known_by_name_and_other_folders_are_sorted() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["zebra", "ant", "mole"] {
        write_video(folder.path(), name, 2);
    }
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let source = VideoSource::Folder(folder.path().to_owned());
    assert_eq!(source.list(VideoSet::Train, None).unwrap(), ["ant", "mole"], "the larger half");
    assert_eq!(source.list(VideoSet::Val, None).unwrap(), ["zebra"]);
    let error = source.list(VideoSet::Train, Some(3)).unwrap_err().to_string();
    assert!(error.contains("2 train videos (the first half of the folder); 3 are needed"), "{error}");
    // Where most names are official, the lists decide.
    for name in ["boat", "bear", "blackswan", "bike-packing"] {
        write_video(folder.path(), name, 2);
    }
    assert_eq!(source.list(VideoSet::Train, None).unwrap(), ["bear", "boat"]);
    assert_eq!(source.list(VideoSet::Val, None).unwrap(), ["bike-packing", "blackswan"]);
    let error = source.list(VideoSet::Train, Some(3)).unwrap_err().to_string();
    assert!(error.contains("2 official train videos of DAVIS; 3 are needed"), "{error}");
    // Those of the other set do not stand in for the ones asked for.
    for name in ["blackswan", "bike-packing", "zebra"] {
        std::fs::remove_dir_all(folder.path().join(name)).unwrap();
    }
    write_video(folder.path(), "bus", 2);
    assert_eq!(source.list(VideoSet::Train, None).unwrap(), ["bear", "boat", "bus"]);
    let error = source.list(VideoSet::Val, None).unwrap_err().to_string();
    assert!(error.contains("no official val video") && error.contains("3 of the other set (bear"), "{error}");
    assert!(!error.contains("--"), "an option that not every program has: {error}");
    assert_eq!((davis::TRAIN.len(), davis::VAL.len()), (60, 30));
    assert!(davis::TRAIN.iter().all(|name| !davis::VAL.contains(name)));
}

/// A film that happens to be named as one of DAVIS is not all that is left of a folder of one's own.
#[test]
fn a_folder_of_ones_own_may_hold_some_names_of_davis() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a", "b", "dog", "train"] {
        write_video(folder.path(), name, 1);
    }
    let source = VideoSource::Folder(folder.path().to_owned());
    assert_eq!(source.lists(None).unwrap(), [["a", "b"], ["dog", "train"]]);
    assert!(!source.is_davis(1));
}

/// Whoever calls eight films of their own by the official names has not got DAVIS.
#[test]
fn davis_has_the_frames_of_its_videos() {
    let folder = tempfile::tempdir().unwrap();
    for (video, frames) in davis::FIRST_FRAMES {
        std::fs::create_dir(folder.path().join(video)).unwrap();
        for frame in 0..frames {
            std::fs::write(folder.path().join(video).join(format!("{frame:05}.jpg")), []).unwrap();
        }
    }
    let source = VideoSource::Folder(folder.path().to_owned());
    assert!(source.is_davis(4) && !source.is_davis(5), "the first four of both lists");
    std::fs::remove_file(folder.path().join("blackswan/00000.jpg")).unwrap();
    assert!(source.is_davis(1) && !source.is_davis(4));
    assert!(!VideoSource::Procedural.is_davis(1));
    let names = davis::FIRST_FRAMES.map(|(video, _)| video);
    assert_eq!((&names[..4], &names[4..]), (&davis::TRAIN[..4], &davis::VAL[..4]));
}

/// A name alone is no film: `0` is in many folders, and folders are copied and moved.
#[test]
fn a_film_is_known_again_in_a_copy_of_its_folder_and_another_of_its_name_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let [own, copy, other, gone] = ["own", "copy", "other", "gone"].map(|name| folder.path().join(name));
    write_video(&own, "0", 3);
    write_video(&copy, "0", 3);
    write_video(&other, "0", 3);
    std::fs::write(other.join("0/00002.png"), b"another picture").unwrap();
    let [own, copy, other, gone] = [own, copy, other, gone].map(VideoSource::Folder);
    let film = |frames| Video { name: "0".to_owned(), set: "val".to_owned(), frames };
    assert!(own.has_film(&film(3), &own) && own.has_film(&film(3), &copy) && own.has_film(&film(3), &gone));
    assert!(!own.has_film(&film(3), &other) && !own.has_film(&film(4), &gone) && !gone.has_film(&film(3), &own));
    let procedural = VideoSource::Procedural;
    assert!(procedural.has_film(&film(60), &procedural));
    assert!(!procedural.has_film(&film(60), &own) && !own.has_film(&film(3), &procedural));
}

/// Two commands do not know each other's counts: no pair of them may share a film.
#[test]
fn what_is_held_out_is_never_trained_under() {
    let folder = tempfile::tempdir().unwrap();
    let source = VideoSource::Folder(folder.path().to_owned());
    for films in 1..=7_usize {
        write_video(folder.path(), &format!("film-{films}"), 1);
        let counts = || (1..=films + 1).map(Some).chain([None, Some(usize::MAX)]);
        let listed = |set| counts().filter_map(|count| source.list(set, count).ok()).collect::<Vec<_>>();
        let (train, val) = (listed(VideoSet::Train), listed(VideoSet::Val));
        // Every count up to that of the half, and all of it.
        assert_eq!((train.len(), val.len()), (films.div_ceil(2) + 1, films / 2 + usize::from(films > 1)), "{films}");
        for (trained, held_out) in train.iter().flat_map(|train| val.iter().map(move |val| (train, val))) {
            assert!(held_out.iter().all(|film| !trained.contains(film)), "{films}: {trained:?}, {held_out:?}");
        }
    }
    let [train, val] = source.lists(None).unwrap();
    assert_eq!((train.len(), val), (4, ["film-5", "film-6", "film-7"].map(str::to_owned).to_vec()));
    assert_eq!(source.lists(Some(2)).unwrap(), [["film-1", "film-2"], ["film-5", "film-6"]]);
    let error = source.lists(Some(4)).unwrap_err().to_string();
    assert!(error.contains("3 val videos (the second half of the folder); 4 are needed"), "{error}");
    let davis = tempfile::tempdir().unwrap();
    ["bear", "blackswan"].iter().for_each(|name| write_video(davis.path(), name, 1));
    let source = VideoSource::Folder(davis.path().to_owned());
    assert_eq!(source.lists(Some(1)).unwrap(), [["bear"], ["blackswan"]]);
    for count in [None, Some(4)] {
        let [train, val] = VideoSource::Procedural.lists(count).unwrap();
        assert!(!train.is_empty() && train.iter().all(|name| !val.contains(name)));
    }
}

#[test]
fn frames_come_sorted_and_again_from_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    write_video(folder.path(), "film", 5);
    let source = VideoSource::Folder(folder.path().to_owned());
    for _ in 0..2 {
        let library = VideoLibrary::open(&source, VideoSet::Val, &["film".to_owned()], 100).unwrap();
        assert_eq!(library.videos(), [Video { name: "film".to_owned(), set: "val".to_owned(), frames: 5 }]);
        let mut bytes = Vec::new();
        for frame in 0..5 {
            library.read(BackgroundFrame { video: 0, frame }, &mut bytes).unwrap();
            assert_eq!(bytes.len(), 3 * (100 * 100 + 50 * 50 + 25 * 25));
            assert!(bytes.chunks(3).all(|rgb| rgb == [frame as u8 * 10, 100, 200]));
        }
        assert!(library.read(BackgroundFrame { video: 0, frame: 5 }, &mut bytes).is_err());
        assert!(library.read(BackgroundFrame { video: 1, frame: 0 }, &mut bytes).is_err());
    }
}

#[test]
fn making_videos_says_how_many_there_are_and_stops_between_frames() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["one", "two", "three"].map(str::to_owned);
    names.iter().for_each(|name| write_video(folder.path(), name, 4));
    let source = VideoSource::Folder(folder.path().to_owned());
    // What came of it where so many frames may be made, and what was said of the videos that are missing, once a frame.
    let open = |most: usize| {
        let said = Mutex::new(Vec::new());
        let go_on = |missing: usize| {
            let mut said = said.lock().unwrap();
            said.push(missing);
            said.len() <= most
        };
        let library = VideoLibrary::open_while(&source, VideoSet::Train, &names, 100, &go_on);
        (library.map(|library| library.frame_counts()), said.into_inner().unwrap())
    };
    let (stopped, said) = open(2);
    assert!(matches!(stopped, Err(Error::Stopped)), "{stopped:?}");
    assert!((3..=12).contains(&said.len()) && said.iter().all(|&missing| missing == 3), "{said:?}");
    let (whole, said) = open(usize::MAX);
    assert_eq!((whole.unwrap(), said), (vec![4; 3], vec![3; 12]));
    let (again, said) = open(0);
    assert_eq!((again.unwrap(), said), (vec![4; 3], Vec::new()), "nothing is left to make");
}

/// A process may have only so many files open.
#[test]
fn a_library_of_many_videos_keeps_no_file_open() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..=MOST_OPEN).map(|number| format!("film-{number}")).collect();
    names.iter().for_each(|name| write_video(folder.path(), name, 1));
    let source = VideoSource::Folder(folder.path().to_owned());
    for (count, is_open) in [(MOST_OPEN, true), (MOST_OPEN + 1, false)] {
        let library = VideoLibrary::open(&source, VideoSet::Train, &names[..count], 16).unwrap();
        assert_eq!(library.stores.iter().filter(|store| store.file.is_some()).count(), if is_open { count } else { 0 });
        library.read(BackgroundFrame { video: count as u32 - 1, frame: 0 }, &mut Vec::new()).unwrap();
    }
}

#[test]
fn frames_play_in_the_order_people_count_without_helper_files() {
    let folder = tempfile::tempdir().unwrap();
    let film = folder.path().join("film");
    std::fs::create_dir_all(&film).unwrap();
    for frame in 1..=12_u8 {
        let picture = image::RgbImage::from_pixel(32, 18, image::Rgb([frame * 10, 100, 200]));
        picture.save(film.join(format!("{frame}.png"))).unwrap();
        std::fs::write(film.join(format!("._{frame}.png")), b"resource fork").unwrap();
    }
    std::fs::write(film.join("Thumbs.db"), b"thumbs").unwrap();
    std::fs::create_dir_all(folder.path().join("__MACOSX/film")).unwrap();
    std::fs::write(folder.path().join("__MACOSX/film/._1.png"), b"resource fork").unwrap();
    std::fs::write(folder.path().join("__MACOSX/a.png"), b"resource fork").unwrap();
    let source = VideoSource::Folder(folder.path().to_owned());
    let names = source.list(VideoSet::Train, None).unwrap();
    assert_eq!(names, ["film"]);
    let library = VideoLibrary::open(&source, VideoSet::Train, &names, 100).unwrap();
    assert_eq!(library.frame_counts(), [12]);
    let mut bytes = Vec::new();
    for frame in 0..12 {
        library.read(BackgroundFrame { video: 0, frame }, &mut bytes).unwrap();
        assert_eq!(bytes[0], (frame as u8 + 1) * 10, "frame {frame}");
    }
}

#[test]
fn half_a_jpeg_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let film = folder.path().join("film");
    std::fs::create_dir_all(&film).unwrap();
    let file = film.join("00000.jpg");
    image::RgbImage::from_fn(64, 36, |x, y| image::Rgb([x as u8 * 3, y as u8 * 7, 90])).save(&file).unwrap();
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    let source = VideoSource::Folder(folder.path().to_owned());
    let error = VideoLibrary::open(&source, VideoSet::Train, &["film".to_owned()], 100).unwrap_err().to_string();
    assert!(error.contains("cut off") && error.contains("00000.jpg"), "{error}");
}

#[test]
fn a_broken_frame_is_named() {
    let folder = tempfile::tempdir().unwrap();
    write_video(folder.path(), "film", 2);
    std::fs::write(folder.path().join("film/00001.png"), b"not a picture").unwrap();
    let source = VideoSource::Folder(folder.path().to_owned());
    let error = VideoLibrary::open(&source, VideoSet::Train, &["film".to_owned()], 100).unwrap_err().to_string();
    assert!(error.contains("00001.png"), "{error}");
    let error = VideoLibrary::open(&source, VideoSet::Train, &["gone".to_owned()], 100).unwrap_err().to_string();
    assert!(error.contains("gone"), "{error}");
    assert!(VideoSource::Folder(folder.path().join("nowhere")).list(VideoSet::Train, None).is_err());
}
