//! Names of results as keys, in expressions and as metrics.

use super::super::tests::writer;
use super::*;

/// What run.json holds is 0.03, and what the metrics hold of it in single precision is not.
#[test]
fn a_name_is_an_option_as_a_key_and_in_an_expression_and_a_number_as_a_metric() {
    let run = tempfile::tempdir().expect("folder");
    let write = writer(run.path());
    let measured = f64::from(0.03f32);
    write("metrics.jsonl", &format!("{{\"update\":10,\"dynamics_weight\":{measured},\"loss\":2.5}}\n"));
    let info = "{\"format\":\"vibes-run/1\",\"options\":{\"dynamics_weight\":0.03},\"model\":{\"task\":\"discs\"},\"recordings\":[],\"episodes\":6,\"steps\":48,\"versions\":{}}";
    write("run.json", info);
    let results = Results::open(&[run.path().to_path_buf()]).expect("run");
    let names = ["dynamics_weight".to_owned()];
    let rows: Rows = "dynamics_weight = 0.03 and loss > 2 and task = 'discs'".parse().expect("expression");
    let read = results.read_with(&names, &names, Some(&rows)).expect("the run");
    assert_eq!(read, [[Cell::Number(0.03), Cell::Number(measured)]]);
    let alone = results.read(&["loss".to_owned()], None).expect("the run");
    assert_eq!(alone, [[Cell::Number(2.5)]], "a metric that is no option");
}

#[test]
fn a_column_of_a_table_may_be_asked_for_twice() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("results.csv");
    std::fs::write(&path, "method,seed,return\na,0,1.5\nb,1,2.5\n").expect("CSV");
    let results = Results::open(&[path]).expect("table");
    let rows: Rows = "seed = 1 and method = 'b'".parse().expect("expression");
    let read = results.read_with(&["seed".to_owned()], &["seed".to_owned(), "return".to_owned()], Some(&rows));
    assert_eq!(read.expect("a row"), [[Cell::Number(1.0), Cell::Number(1.0), Cell::Number(2.5)]]);
}

/// As a run whose scale of rewards was measured before training.
#[test]
fn an_option_goes_before_what_came_of_it_and_what_stands_for_several_things_is_refused() {
    let run = tempfile::tempdir().expect("folder");
    let write = writer(run.path());
    write("metrics.jsonl", "{\"update\":10,\"loss\":2.5}\n");
    write(
        "run.json",
        r#"{"format":"vibes-run/1","options":{"reward_scale":0.0,"a":{"rate":1,"size":3},"b":{"rate":2,"size":3}},
        "model":{"task":"discs","reward_scale":1.9},"recordings":[],"episodes":6,"steps":48,"versions":{}}"#,
    );
    let results = Results::open(&[run.path().to_path_buf()]).expect("run");
    let read = |name: &str, rows: Option<&Rows>| results.read(&[name.to_owned()], rows);
    let number = |name: &str| read(name, None).expect("the run")[0][0].number();
    assert_eq!((number("reward_scale"), number("model.reward_scale")), (Some(0.0), Some(1.9)));
    assert_eq!((number("size"), number("a.rate")), (Some(3.0), Some(1.0)), "one value, or one name");
    let rows: Rows = "reward_scale = 0 and task = 'discs'".parse().expect("expression");
    assert_eq!(read("run", Some(&rows)).expect("the run").len(), 1);
    let fault = read("rate", None).expect_err("two rates").to_string();
    assert!(fault.contains("name one of them in full: options.a.rate, options.b.rate: "), "{fault}");
    let rows: Rows = "rate = 1".parse().expect("expression");
    assert!(matches!(read("run", Some(&rows)), Err(InputError::AmbiguousResult { .. })));
}
