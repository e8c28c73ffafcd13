#!/usr/bin/env bash
# Stands in for rustdoc when `cargo test --doc` runs it: runs the examples in the documentation as asked, and renders the same documentation with
# broken links denied. `cargo doc` would check every dependency a second time for that; here the built ones serve.
set -euo pipefail

rustdoc "$@"

pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
arguments=()
while [ $# -gt 0 ]; do
    case "$1" in
    --test | --no-run | --nocapture) ;;
    --test-run-directory | --test-args | --test-runtool | --test-runtool-arg | --crate-type | --crate-name) shift ;;
    --test-* | --crate-type=* | --crate-name=*) ;;
    *.rs) source=$1 ;;
    *) arguments+=("$1") ;;
    esac
    shift
done
[ -n "${source:-}" ] || exit 0
render() { rustdoc "$@" "${arguments[@]}" -D rustdoc::broken-intra-doc-links -o "$pages"; }
render "$source" --crate-type lib --crate-name "${CARGO_CRATE_NAME:-$(basename "$PWD" | tr - _)}" -D warnings
# A program beside the library has documentation too. Much of it is help text, which has marks of its own, so only its links count.
program=$(dirname "$source")/main.rs
[ ! -f "$program" ] || render "$program" --crate-type bin --crate-name program --document-private-items
