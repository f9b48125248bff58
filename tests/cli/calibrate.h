// `vio-slam calibrate` run in a folder of its own.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "libvio/camera/rig.h"
#include "libvio/io/calibration_file.h"
#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {

class Calibrate : public ::testing::Test {
 protected:
    ProgramResult run(const std::string& arguments) {
        return vio_slam("calibrate " + arguments, folder_.path().string());
    }
    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << text;
        return folder_ / name;
    }
    void expect_error(const std::string& arguments, const std::vector<std::string>& words) {
        expect_one_line(run(arguments), words, arguments);
        EXPECT_FALSE(std::filesystem::exists(folder_ / "out.ini"));
    }
    std::string out() const { return " -o " + folder_ / "out.ini"; }
    Rig written() const {
        Rig rig;
        load_calibration(folder_ / "out.ini", rig);
        return rig;
    }

    ScratchFolder folder_;
};

}  // namespace vio::test
