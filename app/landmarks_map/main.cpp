// vio-landmarks-map RESULT FILE: a result's landmarks as mrpt::maps::CLandmarksMap,
// gzip-compressed. A program of its own, since MRPT's vision library needs a GUI toolkit.
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/CLandmarksMap.h>
#include <mrpt/serialization/CArchive.h>

#include <iostream>

#include "libvio/base/errors.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/results.h"

namespace {

mrpt::maps::CLandmark converted(const vio::LandmarkEstimate& from, vio::TimeNs last_seen) {
    mrpt::maps::CLandmark to;
    to.ID = from.id;
    to.pose_mean = {from.p_W.x(), from.p_W.y(), from.p_W.z()};
    const auto covariance = [&](int r, int c) { return static_cast<float>(from.covariance(r, c)); };
    to.pose_cov_11 = covariance(0, 0);
    to.pose_cov_22 = covariance(1, 1);
    to.pose_cov_33 = covariance(2, 2);
    to.pose_cov_12 = covariance(0, 1);
    to.pose_cov_13 = covariance(0, 2);
    to.pose_cov_23 = covariance(1, 2);
    to.seenTimesCount = static_cast<std::uint32_t>(from.observations);
    to.timestampLastSeen = vio::to_mrpt(last_seen);
    to.createOneFeature();
    to.features[0].type = mrpt::vision::featNotDefined;
    return to;
}

int write_map(const std::string& folder, const std::string& file) {
    const vio::Estimate estimate = vio::read_results(folder);
    mrpt::maps::CLandmarksMap map;
    for (const vio::LandmarkEstimate& landmark : estimate.landmarks)
        map.landmarks.push_back(converted(landmark, estimate.states.back().t));
    mrpt::io::CFileGZOutputStream out;
    if (!out.open(file)) throw vio::InputError(file + ": cannot be written");
    mrpt::serialization::archiveFrom(out) << map;
    std::cout << file << ": " << map.size() << " landmarks\n";
    return 0;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc == 3) return write_map(argv[1], argv[2]);
    std::cerr << "usage: vio-landmarks-map RESULT FILE.gz\n";
    return 2;
} catch (const std::exception& error) {
    std::cerr << "vio-landmarks-map: " << error.what() << '\n';
    return 1;
}
