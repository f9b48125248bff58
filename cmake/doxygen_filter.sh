#!/bin/sh
# A header for Doxygen: its first comment becomes the documentation of the file; an @ in a comment is
# one (of MRPT's INI directives, say), no command.
awk '/\/\// { gsub(/@/, "\\\\@") }
     NR == 1 && /^\/\// { print "/// \\file"; head = 1 }
     head && /^\/\// { sub(/^\/\/+/, "///"); print; next }
     { head = 0; print }' "$1"
