// Tests that need what not every machine has.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

// Skips a test for want of what `reason` names; with an empty reason nothing is wanting. Where
// everything has been installed (./run test sets VIO_NO_SKIPS) the want is a fault of our own.
#define VIO_SKIP_FOR(reason)                                        \
    if (const std::string wanting = (reason); wanting.empty()) {    \
    } else if (std::getenv("VIO_NO_SKIPS")) {                       \
        FAIL() << wanting << " (not skipped: VIO_NO_SKIPS is set)"; \
    } else                                                          \
        GTEST_SKIP() << wanting
