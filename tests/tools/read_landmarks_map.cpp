// read_landmarks_map FILE RESULT: exits with 0 if the CLandmarksMap holds the result's landmarks:
// places to the bit, covariances (which MRPT stores in single precision) to 1e-7 of the largest.
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/maps/CLandmarksMap.h>
#include <mrpt/serialization/CArchive.h>

#include <iostream>

#include "libvio/io/results.h"

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    mrpt::maps::CLandmarksMap map;
    mrpt::io::CFileGZInputStream in(argv[1]);
    mrpt::serialization::archiveFrom(in) >> map;
    const auto landmarks = vio::read_results(argv[2]).landmarks;
    size_t equal = 0;
    for (const vio::LandmarkEstimate& landmark : landmarks) {
        const auto* found = map.landmarks.getByID(landmark.id);
        if (!found) continue;
        const Eigen::Vector3d p(found->pose_mean.x, found->pose_mean.y, found->pose_mean.z);
        Eigen::Matrix3d C;
        C << found->pose_cov_11, found->pose_cov_12, found->pose_cov_13, found->pose_cov_12,
            found->pose_cov_22, found->pose_cov_23, found->pose_cov_13, found->pose_cov_23,
            found->pose_cov_33;
        const double largest = landmark.covariance.cwiseAbs().maxCoeff();
        equal += p == landmark.p_W &&
                 static_cast<int>(found->seenTimesCount) == landmark.observations &&
                 (C - landmark.covariance).cwiseAbs().maxCoeff() <= 1e-7 * largest;
    }
    std::cout << equal << " of " << landmarks.size() << " landmarks are equal\n";
    return !landmarks.empty() && equal == landmarks.size() && map.size() == equal ? 0 : 1;
}
