#include "libvio/batch/batch.h"

namespace vio {

void BatchOptions::describe(OptionSet& o) {
    o.section("batch");
    o.add("sigma_px", &sigma_px, "px", {1e-3, 100}, "standard deviation of a feature's position");
    o.add("weighting", &weighting, {"preintegrated", "fixed"},
          "covariance of the inertial terms: from the noise densities, or fixed (the paper)");
    o.add("fixed_variance", &fixed_variance, "rad^2, m^2, (m/s)^2", {1e-12, 1},
          "variance of rotation, position and velocity when weighting is fixed");
    o.add("gravity", &gravity, {"magnitude", "free"}, "gravity has a known norm, or is free");
    o.add("gravity_norm", &gravity_norm, "m/s^2", {1e-6, 100}, "norm of gravity");
    o.add("bias", &bias, {"random_walk", "constant"}, "biases drift, or are constant (the paper)");
    o.add("accel_bias_sigma", &accel_bias_sigma, "m/s^2", {1e-6, 100},
          "standard deviation of the accelerometer bias, Eq. (12)");
    o.add("gyro_bias_sigma", &gyro_bias_sigma, "rad/s", {1e-6, 10},
          "standard deviation of the gyro bias");
    o.add("loss", &loss, {"none", "huber", "cauchy"}, "robust loss of the image terms");
    o.add("loss_width", &loss_width, "standard deviations", {0.1, 100}, "width of the robust loss");
    o.add("start", &start, {"auto", "blind", "staged", "iekf"},
          "all images at once from nothing (blind, section 4.6), grown from a prefix (staged), or "
          "the recursive estimate (iekf); auto: the recursive estimate, else staged");
    o.add("blind_distance", &blind_distance, "m", {1e-3, 1e4},
          "distance to which a blind start backprojects points");
    o.add("prefix_images", &prefix_images, "", {2, 1000}, "images that a staged start begins with");
    o.add("max_iterations", &max_iterations, "", {1, 10000}, "iterations of one minimisation");
    o.add("cost_tolerance", &cost_tolerance, "", {0, 1}, "relative decrease that ends it");
    o.add("outlier_sigmas", &outlier_sigmas, "standard deviations", {0, 1e6},
          "observations further off than this are dropped after convergence; 0: none");
    o.add("intrinsics_sigma", &intrinsics_sigma, "px", {0, 1e3},
          "how well focal lengths, centre and distortion of the camera (before a mirror: of the "
          "camera alone) are known, as the displacement of a pixel; the batch estimator estimates "
          "them with everything else. 0: exactly");
    o.add("extrinsics_rotation_sigma", &extrinsics_rotation_sigma, "deg", {0, 180},
          "the same for the camera's rotation on the IMU; takes an IMU, as do the next two");
    o.add("extrinsics_position_sigma", &extrinsics_position_sigma, "m", {0, 100},
          "the same for its position on the IMU");
    o.add("time_offset_sigma", &time_offset_sigma, "s", {0, 10},
          "the same for the time offset between camera and IMU");
    o.add("threads", &threads, "", {0, 64}, "threads; 0: one for each processor");
    o.add("covariances", &covariances, "compute covariances of states and landmarks");
}

}  // namespace vio
