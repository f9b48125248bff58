# Writes the header OUTPUT with the program's version: VERSION, and what git calls the SOURCE tree.
set(version ${VERSION})
set(date "")
if(EXISTS ${SOURCE}/.git)
  execute_process(COMMAND git describe --always --dirty --tags WORKING_DIRECTORY ${SOURCE}
                  OUTPUT_VARIABLE description OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(description)
  string(APPEND version " (${description})")
  execute_process(COMMAND git log -1 --format=%cs WORKING_DIRECTORY ${SOURCE}
                  OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT [[#pragma once

#define VIO_VERSION "@version@"
#define VIO_DATE "@date@"
]] @ONLY)
