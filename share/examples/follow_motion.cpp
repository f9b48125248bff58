// Feeds observations one by one to an estimator that is made by name, and prints poses as they
// come:
//   follow_motion vio::RecursiveEstimator NAME.rawlog NAME.calibration.ini > poses.tum
// A live program does the same with the observations of its drivers.
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/rtti/CObject.h>
#include <mrpt/serialization/CArchive.h>

#include <cstdio>
#include <iostream>

#include "libvio/slam/motion_estimator.h"

namespace {

void print(const vio::MotionEstimator::StampedPose& pose) {
    mrpt::math::CQuaternionDouble q;
    pose.pdf.mean.getAsQuaternion(q);
    const auto& p = pose.pdf.mean;
    std::printf("%.7f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", mrpt::Clock::toDouble(pose.stamp),
                p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.r());
}

int follow(const std::string& name, const std::string& rawlog, const std::string& calibration) {
    const auto estimator =
        std::dynamic_pointer_cast<vio::MotionEstimator>(mrpt::rtti::classFactory(name));
    if (!estimator) throw std::runtime_error(name + ": no such estimator");
    estimator->set_calibration(calibration);  // the IMU's noise, which no observation holds
    mrpt::io::CFileGZInputStream file;
    if (!file.open(rawlog)) throw std::runtime_error(rawlog + ": cannot be read");
    auto archive = mrpt::serialization::archiveFrom(file);
    mrpt::Clock::time_point printed;
    const auto print_new = [&] {  // but for poses that are guesses, without track of the scene
        const auto pose = estimator->newest_pose();
        if (pose && !pose->lost && pose->stamp != printed) print(*pose), printed = pose->stamp;
    };
    try {
        while (true) {
            estimator->process(*archive.ReadObject<mrpt::obs::CObservation>());
            print_new();
        }
    } catch (const mrpt::serialization::CExceptionEOF&) {  // the end of the rawlog
    }
    estimator->finish();
    print_new();
    return 0;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc == 4) return follow(argv[1], argv[2], argv[3]);
    std::cerr
        << "usage: follow_motion vio::RecursiveEstimator|vio::BatchEstimator RAWLOG CALIBRATION\n";
    return 2;
} catch (const std::exception& error) {
    std::cerr << "follow_motion: " << error.what() << '\n';
    return 1;
}
