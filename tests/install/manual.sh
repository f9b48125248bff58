#!/usr/bin/env bash
# Every option that --help of a command shows stands in the manual page and is completed by bash.
#   manual.sh PROGRAM
set -euo pipefail
program=$1
PATH=$(dirname "$program"):$PATH
page=$("$program" --print-man-page)
source <("$program" --print-bash-completion)
fail() {
    echo "$*" >&2
    exit 1
}

# complete WORD...: what Tab offers for the last word.
complete_words() {
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
    _vio_slam 2>/dev/null || true
    printf '%s\n' "${COMPREPLY[@]}"
}
# offered WORD COMMAND...: whether Tab offers the word. (grep ends at the first match: a pipe to it
# would now and then break before all is written.)
offered() { grep --quiet --line-regexp -- "$1" <<<"$(complete_words "${@:2}")"; }
compopt() { :; } # bash has it only while it completes

options=0
# check COMMAND...: its help against page and completion, and so the commands below it.
check() {
    local help option sub section
    help=$("$program" "$@" --help)
    # The part of the page that is the command's: from its heading to the next.
    section=$(awk -v head=".SS vio\\-slam${*:+ ${*//-/\\-}}" '$0 == head { on = 1; next } /^\.S[SH]/ { on = 0 } on' \
        <<<"$page")
    for option in $(grep --only-matching --extended-regexp '^  (-[a-z],)?--[a-z-]+' <<<"$help" |
        grep --only-matching --extended-regexp -- '--[a-z-]+'); do
        [[ $# -eq 0 ]] || grep --quiet --fixed-strings -- "${option//-/\\-}" <<<"$section" ||
            fail "the manual of '$*' lacks $option"
        offered "$option" vio-slam "$@" "$option" ||
            fail "'$* $option' is not completed"
        options=$((options + 1))
    done
    for sub in $(awk '/^Subcommands:/ { on = 1; next } on && /^  [a-z]/ { print $1 }' <<<"$help"); do
        offered "$sub" vio-slam "$@" "$sub" ||
            fail "'$* $sub' is not completed"
        check "$@" "$sub"
    done
}
check

[[ $(complete_words vio-slam run x.rawlog --estimator b) == batch ]] || fail "a choice is not completed"
# Options of one command are not offered for another, nor after a value that is named like a command.
offered --camera-label vio-slam run -o import --cam ||
    fail "the options of run are lost behind 'import'"
((options > 100)) || fail "only $options options were found"
if command -v man >/dev/null; then
    warnings=$("$program" --print-man-page | MANROFFSEQ='' man --warnings=w --local-file - 2>&1 >/dev/null)
    [[ -z $warnings ]] || fail "man: $warnings"
fi
echo "$options options are in the manual and are completed"
