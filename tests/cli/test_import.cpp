// Importers, export and calibrate imu from the command line.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "tests/cli/program.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

class ImportCommands : public ::testing::Test {
 protected:
    ProgramResult run(const std::string& arguments) {
        return vio_slam(arguments, folder_.path().string());
    }
    // Readings at rest in a phone's units: deg/s and g, iOS's sign, ms.
    std::string phone_table(int count) {
        std::ofstream out(folder_ / "imu.csv");
        std::mt19937_64 rng(1);
        std::normal_distribution<double> normal;
        out << "time,gx,gy,gz,ax,ay,az\n";
        for (int i = 0; i < count; ++i) {
            out << 1000 + 20 * i;
            for (int k = 0; k < 6; ++k) out << ',' << 0.01 * normal(rng) - (k == 5 ? 1 : 0);
            out << '\n';
        }
        return folder_ / "imu.csv";
    }
    void expect_refusal(const std::string& arguments, const std::string& words) {
        const ProgramResult result = run(arguments);
        EXPECT_EQ(result.exit_code, 1) << arguments;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
    }

    ScratchFolder folder_;
};

// Of a table with holes the rest is imported, and the first hole's place is told.
TEST_F(ImportCommands, ReadingsWithoutANumberAreToldAndLeftOut) {
    const std::string table = phone_table(50);
    std::ofstream(table, std::ios::app)
        << "2000,1,nan,0,0,0,-1\n2020,0,0,0,0,,-1\n2040,0,0,0,0,0,-1\n";
    const ProgramResult import = run("import csv --imu " + table +
                                     " --imu-columns time,gx,gy,gz,ax,ay,az --time-unit ms -o " +
                                     (folder_ / "phone.rawlog"));
    EXPECT_EQ(import.exit_code, 0) << import.err;
    EXPECT_NE(import.out.find("51 IMU readings, 1.04 s"), std::string::npos) << import.out;
    EXPECT_NE(import.out.find("left out: 2 IMU readings; the first: " + table +
                              " (line 52): 'nan' is not a finite number\n"),
              std::string::npos)
        << import.out;
    std::ofstream(table) << "time,gx,gy,gz,ax,ay,az\n1,nan,0,0,0,0,-1\n";
    expect_refusal("import csv --imu " + table +
                       " --imu-columns time,gx,gy,gz,ax,ay,az --time-unit ms -o " +
                       (folder_ / "none.rawlog"),
                   "'nan' is not a finite number; so all had to be left out: 1");
}

TEST_F(ImportCommands, ATableBecomesARawlogWhoseNoiseIsMeasured) {
    const std::string table = phone_table(50 * 90), rawlog = folder_ / "phone.rawlog";
    const ProgramResult import =
        run("import csv --imu " + table +
            " --imu-columns time,gx,gy,gz,ax,ay,az --time-unit ms --gyro-unit deg/s --accel-unit g "
            "--accel-reversed -o " +
            rawlog);
    EXPECT_EQ(import.exit_code, 0) << import.err;
    EXPECT_NE(import.out.find("4500 IMU readings, 89.98 s"), std::string::npos) << import.out;

    const ProgramResult noise = run("calibrate imu " + rawlog + " -o " + (folder_ / "imu.ini"));
    EXPECT_EQ(noise.exit_code, 0) << noise.err;
    EXPECT_NE(noise.out.find("too short"), std::string::npos) << noise.out;
    // 0.01 deg/s at 50 Hz: 0.01 pi/180 / sqrt(50) = 2.47e-5, to the 3 % that 90 s tell it to.
    std::ifstream in(folder_ / "imu.ini");
    double density = 0;
    for (std::string line; std::getline(in, line);)
        if (line.rfind("gyro_noise_density = ", 0) == 0) density = std::stod(line.substr(21));
    EXPECT_NEAR(density, 2.47e-5, 3 * 0.03 * 2.47e-5);
    // What run and the others take.
    const ProgramResult info = run("info " + rawlog + " --calibration " + (folder_ / "imu.ini"));
    EXPECT_EQ(info.exit_code, 0) << info.err;
    EXPECT_NE(info.out.find("gyro noise 2."), std::string::npos) << info.out;
}

TEST_F(ImportCommands, ARecordingGoesToAslAndBack) {
    const std::string demo = std::string(VIO_SOURCE_DIR) + "/datasets/demo.rawlog";
    const ProgramResult there = run("export " + demo + " --as asl -o " + (folder_ / "asl"));
    EXPECT_EQ(there.exit_code, 0) << there.err;
    EXPECT_NE(there.out.find("152 images"), std::string::npos) << there.out;
    const ProgramResult back =
        run("import asl " + (folder_ / "asl") + " -o " + (folder_ / "again.rawlog"));
    EXPECT_EQ(back.exit_code, 0) << back.err;
    EXPECT_NE(back.out.find("152 true poses"), std::string::npos) << back.out;
    expect_refusal("export " + demo + " --as asl -o " + (folder_ / "asl"), "exists already");
}

TEST_F(ImportCommands, WhatIsWrongIsOneLine) {
    const std::string table = phone_table(10), out = " -o " + (folder_ / "x.rawlog");
    expect_refusal("import csv" + out, "neither images nor IMU");
    expect_refusal("import csv --imu " + table + " --imu-columns t,a,b" + out, "3 columns");
    expect_refusal("import csv --imu " + table + " --imu-columns t,gx,gy,gz,ax,ay,az" + out,
                   "no column 't'");
    expect_refusal("import kitti " + folder_.path().string() + out, "image_00/timestamps.txt");
    expect_refusal("import tum-vi " + folder_.path().string() + out, "dso/camchain.yaml");
    expect_refusal("calibrate imu " + table + " -o " + (folder_ / "i.ini"), "imu.csv");
    expect_refusal("calibrate imu " + std::string(VIO_SOURCE_DIR) + "/datasets/demo.rawlog -o " +
                       (folder_ / "i.ini"),
                   "shorter than a minute");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "x.rawlog"));
}

}  // namespace
}  // namespace vio::test
