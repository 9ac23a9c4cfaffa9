//! `sim report` and `sim render` over driven, recorded runs: the page in a browser, pictures, and clips.

use std::fs;

use serde_json::json;

use crate::browser::Browser;
use crate::stage::Stage;

/// A run of the small set by a driver that sees nothing, so that something happens, and the page of it.
fn page(stage: &Stage, more: &str) -> std::path::PathBuf {
    stage.good_sim("run --scenarios small.toml --driver idm");
    stage.good_sim(&format!(
        "report runs/idm-strict-1 --html out.html --episodes following-3-0,curve-3-0,red-light-3-0 {more}"
    ));
    stage.path("out.html")
}

#[test]
fn the_page_plays_and_scrubs_by_clicks_and_keys_on_every_screen() {
    let Some(program) = Browser::find() else { return };
    let stage = Stage::new();
    let page = page(&stage, "");
    let mut browser = Browser::open(&program, &stage.path("profile"), &page);
    browser.screen(1280, 900, false);
    browser.media("light", "screen");
    browser.wait_for("document.querySelector('#step')?.textContent");
    // Frames: 0 is before the first step.
    let step = "Number(document.getElementById('range').value)";
    let last = browser.value("Number(document.getElementById('range').max)").as_u64().unwrap();
    assert!(last > 20, "{last}");

    // Keys, with the picture in focus.
    browser.value("document.getElementById('stage').focus()");
    browser.press("Home", false);
    assert_eq!(browser.value(step), json!(0));
    browser.press("ArrowRight", false);
    browser.press("ArrowRight", true);
    assert_eq!(browser.value(step), json!(11));
    browser.press("ArrowLeft", false);
    assert_eq!(browser.value(step), json!(10));
    browser.press("End", false);
    assert_eq!(browser.value(step), json!(last));
    browser.press("Home", false);
    browser.press(" ", false);
    browser.wait_for(&format!("{step} >= 3"));
    browser.press(" ", false);
    assert_eq!(browser.value("document.getElementById('play').textContent"), json!("Play"));

    // Clicks.
    browser.click("#play");
    assert_eq!(browser.value("document.getElementById('play').textContent"), json!("Pause"));
    let before = browser.value(step).as_u64().unwrap();
    browser.wait_for(&format!("{step} >= {}", before + 3));
    browser.click("#play");
    browser.click_at("#timeline", 0.5);
    let middle = browser.value(step).as_u64().unwrap();
    assert!(middle.abs_diff(last / 2) <= 1, "{middle} of {last}");
    browser.click("#forth");
    assert_eq!(browser.value(step), json!(middle + 1));
    browser.click_at("#range", 0.25);
    let quarter = browser.value(step).as_u64().unwrap();
    assert!(quarter.abs_diff(last / 4) <= 3, "{quarter} of {last}");
    if browser.value("document.querySelectorAll('#events button').length > 0") == json!(true) {
        browser.click("#events button");
        let frame = browser.value("Number(document.querySelector('#events li').dataset.frame)");
        assert_eq!(browser.value(step), frame);
    }
    // Another drive, by the table.
    let title = browser.value("document.getElementById('title').textContent");
    browser.click("#next");
    browser.wait_for(&format!("document.getElementById('title').textContent !== {title}"));
    browser.click("#scenes td.play button");
    browser.wait_for("location.hash.startsWith('#drive-')");

    // The picture is one: it has many colours, and others in the dark.
    let colours = "(() => { const stage = document.getElementById('stage'); \
                   const { data } = stage.getContext('2d').getImageData(0, 0, stage.width, stage.height); \
                   return [...new Set(new Uint32Array(data.buffer))].length; })()";
    assert!(browser.value(colours).as_u64().unwrap() > 20);
    browser.picture("desktop", true);
    let ground = "document.getElementById('stage').getContext('2d').getImageData(1, 1, 1, 1).data[0]";
    let background = "getComputedStyle(document.body).backgroundColor";
    assert_eq!(browser.value(background), json!("rgb(255, 255, 255)"));
    browser.media("dark", "screen");
    browser.wait_for(&format!("{ground} < 100"));
    assert_eq!(browser.value(background), json!("rgb(15, 18, 22)"));
    browser.picture("desktop-dark", true);

    // A phone: nothing is wider than the screen, and what is touched is large enough.
    browser.screen(390, 844, true);
    browser.wait_for("document.getElementById('stage').clientWidth < 390");
    assert_eq!(browser.value("document.documentElement.scrollWidth"), json!(390));
    assert!(browser.value("document.getElementById('play').getBoundingClientRect().height").as_f64().unwrap() >= 40.0);
    browser.picture("phone-dark", true);
    browser.media("light", "screen");
    browser.picture("phone", true);

    // Paper.
    browser.screen(800, 1100, false);
    browser.media("dark", "print");
    assert_eq!(browser.value("getComputedStyle(document.querySelector('nav')).display"), json!("none"));
    assert_eq!(browser.value(background), json!("rgb(255, 255, 255)"));
    browser.picture("paper", true);
    assert!(browser.trouble.is_empty(), "{:#?}", browser.trouble);
}

#[test]
fn the_table_is_filtered_by_reason_and_by_words() {
    let Some(program) = Browser::find() else { return };
    let stage = Stage::new();
    let page = page(&stage, "");
    let mut browser = Browser::open(&program, &stage.path("profile"), &page);
    browser.wait_for("document.querySelector('#shown')?.textContent");
    let rows = "document.querySelectorAll('#scenes tbody tr').length";
    assert_eq!(browser.value(rows), json!(3));
    browser.value("(() => { const find = document.getElementById('find'); find.value = 'curve'; find.dispatchEvent(new Event('input')); })()");
    assert_eq!(browser.value(rows), json!(1));
    browser.value("(() => { const find = document.getElementById('find'); find.value = ''; find.dispatchEvent(new Event('input')); })()");
    browser.click("#reasons button:last-child");
    let told = browser.value("document.querySelector('#reasons button:last-child').textContent");
    let count = told.as_str().unwrap().rsplit(' ').next().unwrap().parse::<u64>().unwrap();
    assert_eq!(browser.value(rows), json!(count));
    browser.click("#reasons button:last-child");
    browser.click("#scenes th[data-key=scene] button");
    assert_eq!(browser.value("document.querySelector('#scenes td.id').textContent"), json!("curve-3-0"));
    assert!(browser.trouble.is_empty(), "{:#?}", browser.trouble);
}

#[test]
fn the_page_is_the_same_for_any_number_of_threads_and_no_drive_is_large() {
    let stage = Stage::new();
    let page = page(&stage, "");
    let one = fs::read_to_string(&page).unwrap();
    let again = "report runs/idm-strict-1 --html again.html --episodes following-3-0,curve-3-0,red-light-3-0";
    let ended = stage.command(again).env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert!(ended.status.success());
    assert!(one == fs::read_to_string(stage.path("again.html")).unwrap(), "another page with one thread");
    let reels: Vec<&str> =
        one.split("<script class=\"reel\"").skip(1).map(|rest| rest.split("</script>").next().unwrap()).collect();
    assert_eq!(reels.len(), 3);
    assert!(
        reels.iter().all(|reel| (1_000..150_000).contains(&reel.len())),
        "{:?}",
        reels.iter().map(|reel| reel.len())
    );
    assert!(!one.contains("No plans or predictions"), "they are recorded");
}

#[test]
fn a_run_without_recordings_says_so_and_scenes_that_are_gone_cost_the_players_alone() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm --record none");
    stage.good_sim("report runs/idm-strict-1 --html out.html --episodes curve-3-0");
    assert!(fs::read_to_string(stage.path("out.html")).unwrap().contains("No plans or predictions are recorded"));
    fs::rename(stage.path("small.toml"), stage.path("moved.toml")).unwrap();
    let ended = stage.good_sim("report runs/idm-strict-1 --html out.html --episodes curve-3-0");
    assert!(ended.err.contains("has no player") && ended.out.contains(" 0 drives"), "{ended:?}");
    let ended = stage.good_sim("report runs/idm-strict-1 --html out.html --episodes curve-3-0 --scenarios moved.toml");
    assert!(ended.err.is_empty() && ended.out.contains(" 1 drives"), "{ended:?}");
}

#[test]
fn a_step_is_a_picture_and_a_drive_a_clip() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm");
    let render = |more: &str| stage.sim(&format!("render runs/idm-strict-1 --episode curve-3-0 {more}"));
    let ended = render("--png 20");
    assert_eq!((ended.code, ended.out.as_str()), (Some(0), "curve-3-0-20.png: 960 x 540 pixels\n"), "{ended:?}");
    let first = fs::read(stage.path("curve-3-0-20.png")).unwrap();
    assert!(first.starts_with(b"\x89PNG") && first.len() > 10_000, "{}", first.len());
    // The same again; another step is another picture.
    assert_eq!(render("--png 20 --out again.png").code, Some(0));
    assert!(first == fs::read(stage.path("again.png")).unwrap());
    assert_eq!(render("--png last --out last.png").code, Some(0));
    assert!(first != fs::read(stage.path("last.png")).unwrap());
    let ended = render("--gif --size 160x90 --out small.gif");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(fs::read(stage.path("small.gif")).unwrap().starts_with(b"GIF89a"));
    let nowhere = render("--png 9999");
    assert!(nowhere.code == Some(2) && nowhere.err.contains("so no step 9999\nhint: "), "{nowhere:?}");
    let nobody = stage.sim("render runs/idm-strict-1 --episode nobody --png 0");
    assert!(nobody.code == Some(2) && nobody.err.contains("has no episode nobody\nhint: "), "{nobody:?}");
}

#[test]
fn videos_are_ffmpegs_and_where_there_is_none_that_is_said() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm");
    let arguments = "render runs/idm-strict-1 --episode curve-3-0 --mp4 --size 320x180";
    let without = stage.command(arguments).env("PATH", "").output().unwrap();
    let said = String::from_utf8(without.stderr).unwrap();
    assert!(
        without.status.code() == Some(2) && said.contains("there is no ffmpeg") && said.contains("--gif"),
        "{said}"
    );
    let path = std::env::var_os("PATH").unwrap_or_default();
    if !std::env::split_paths(&path).any(|folder| folder.join("ffmpeg").is_file()) {
        eprintln!("skipped: there is no ffmpeg");
        return;
    }
    let ended = stage.good_sim(arguments);
    assert!(ended.out.contains("frames of 320 x 180"), "{ended:?}");
    assert_eq!(&fs::read(stage.path("curve-3-0.mp4")).unwrap()[4..8], b"ftyp");
    assert!(!stage.path("curve-3-0.mp4.partial").exists());
}
