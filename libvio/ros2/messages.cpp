#include "libvio/ros2/messages.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "libvio/camera/description.h"

namespace vio {
namespace {

Eigen::Vector3d read_vector(Cdr& cdr) {
    const auto v = cdr.numbers<3>();
    const Eigen::Vector3d vector(v[0], v[1], v[2]);
    if (!vector.allFinite()) throw cdr.error("holds a value that is not finite");
    return vector;
}

// Position, then quaternion x y z w: geometry_msgs' Pose and Transform alike.
Pose read_rigid(Cdr& cdr) {
    Pose T;
    T.p = read_vector(cdr);
    const auto q = cdr.numbers<4>();
    const Eigen::Quaterniond quaternion(q[3], q[0], q[1], q[2]);
    if (!(std::abs(quaternion.norm() - 1) < 0.01))
        throw cdr.error("its quaternion is not of unit length");
    T.R = quaternion.normalized().toRotationMatrix();
    return T;
}

// seconds and nanoseconds, frame: zero where it was never set.
Ros2Header read_any_header(Cdr& cdr) {
    const auto seconds = cdr.number<std::int32_t>();
    const auto nanoseconds = cdr.number<std::uint32_t>();
    return {seconds * TimeNs{1'000'000'000} + nanoseconds, std::string(cdr.text())};
}

// How an image is stored and how it becomes grey.
struct Encoding {
    int type;
    std::optional<int> to_grey;  ///< OpenCV's conversion; none: it is grey
};

// OpenCV names Bayer patterns after the second row's second and third pixel.
const std::map<std::string_view, Encoding>& encodings() {
    static const std::map<std::string_view, Encoding> all = {
        {"mono8", {CV_8UC1, {}}},
        {"8UC1", {CV_8UC1, {}}},
        {"mono16", {CV_16UC1, {}}},
        {"16UC1", {CV_16UC1, {}}},
        {"bgr8", {CV_8UC3, cv::COLOR_BGR2GRAY}},
        {"8UC3", {CV_8UC3, cv::COLOR_BGR2GRAY}},
        {"rgb8", {CV_8UC3, cv::COLOR_RGB2GRAY}},
        {"bgra8", {CV_8UC4, cv::COLOR_BGRA2GRAY}},
        {"rgba8", {CV_8UC4, cv::COLOR_RGBA2GRAY}},
        {"bgr16", {CV_16UC3, cv::COLOR_BGR2GRAY}},
        {"rgb16", {CV_16UC3, cv::COLOR_RGB2GRAY}},
        {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2GRAY}},
        {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2GRAY}},
        {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2GRAY}},
        {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2GRAY}},
        {"yuv422", {CV_8UC2, cv::COLOR_YUV2GRAY_UYVY}},
        {"uyvy", {CV_8UC2, cv::COLOR_YUV2GRAY_UYVY}},
        {"yuv422_yuy2", {CV_8UC2, cv::COLOR_YUV2GRAY_YUY2}},
        {"yuyv", {CV_8UC2, cv::COLOR_YUV2GRAY_YUY2}}};
    return all;
}

void swap_bytes(cv::Mat& image) {
    for (int row = 0; row < image.rows; ++row) {
        auto* values = image.ptr<std::uint16_t>(row);
        for (int i = 0; i < image.cols * image.channels(); ++i)
            values[i] = static_cast<std::uint16_t>(values[i] << 8 | values[i] >> 8);
    }
}

cv::Mat as_grey(const cv::Mat& stored, std::optional<int> conversion) {
    if (!conversion) return stored.clone();
    cv::Mat grey;  // apart from `stored`: mosaics are not converted in their own place
    cv::cvtColor(stored, grey, *conversion);
    return grey;
}

}  // namespace

Ros2Header read_header(Cdr& cdr) {
    Ros2Header header = read_any_header(cdr);
    if (header.t <= 0) throw cdr.error("its header bears no time stamp");
    return header;
}

ImuReading read_imu(Cdr& cdr, TimeNs t) {
    cdr.numbers<13>();  // orientation and its covariance
    ImuReading reading;
    reading.t = t;
    reading.gyro = read_vector(cdr);
    cdr.numbers<9>();
    reading.accel = read_vector(cdr);
    return reading;
}

cv::Mat read_image(Cdr& cdr) {
    const auto height = cdr.number<std::uint32_t>(), width = cdr.number<std::uint32_t>();
    const std::string name(cdr.text());
    const bool big_endian = cdr.number<std::uint8_t>() != 0;
    const auto step = cdr.number<std::uint32_t>();
    const Bytes data = cdr.bytes();
    const auto encoding = encodings().find(name);
    if (encoding == encodings().end())
        throw cdr.error("images of the encoding '" + name +
                        "' are not read; record them as mono8, rgb8 or bgr8");
    const auto& [type, conversion] = encoding->second;
    constexpr std::uint32_t kSmallestSide = 4, kLargestSide = 1 << 16;
    const bool in_pairs = type == CV_8UC2;  // YUV: two pixels share their colour
    if (std::min(width, height) < kSmallestSide || std::max(width, height) > kLargestSide ||
        (in_pairs && width % 2 != 0) || step < width * CV_ELEM_SIZE(type) ||
        data.size() < std::size_t{step} * height)
        throw cdr.error("the image's size does not fit its data");
    cv::Mat stored(static_cast<int>(height), static_cast<int>(width), type,
                   const_cast<std::uint8_t*>(data.data()), step);
    if (CV_MAT_DEPTH(type) == CV_16U && big_endian) {
        stored = stored.clone();
        swap_bytes(stored);
    }
    return as_grey(stored, conversion);
}

cv::Mat read_compressed_image(Cdr& cdr) {
    const std::string format(cdr.text());
    const Bytes data = cdr.bytes();
    cv::Mat image;
    if (!data.empty())
        image = cv::imdecode(cv::Mat(1, static_cast<int>(data.size()), CV_8UC1,
                                     const_cast<std::uint8_t*>(data.data())),
                             cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
    if (image.empty()) throw cdr.error("the image (" + format + ") cannot be decoded");
    return image;
}

CameraPtr read_camera_info(Cdr& cdr, bool rectified) {
    CameraDescription d;
    d.lens.height = static_cast<int>(cdr.number<std::uint32_t>());
    d.lens.width = static_cast<int>(cdr.number<std::uint32_t>());
    const std::string model(cdr.text());
    const auto count = cdr.number<std::uint32_t>();
    if (count > 100) throw cdr.error("holds too many coefficients of distortion");
    std::vector<double> distortion;
    for (std::uint32_t i = 0; i < count; ++i) distortion.push_back(cdr.number<double>());
    const auto K = cdr.numbers<9>();
    cdr.numbers<9>();  // R
    const auto P = cdr.numbers<12>();
    const auto binning_x = cdr.number<std::uint32_t>(), binning_y = cdr.number<std::uint32_t>();
    const auto roi_x = cdr.number<std::uint32_t>(), roi_y = cdr.number<std::uint32_t>();
    if (binning_x > 1 || binning_y > 1 || roi_x > 0 || roi_y > 0)
        throw cdr.error("states the intrinsics of images before binning or cropping");
    if (rectified) {
        d.lens.fx = P[0], d.lens.fy = P[5], d.lens.cx = P[2], d.lens.cy = P[6];
        if (d.lens.fx == 0) return {};
        return make_camera(d);
    }
    d.lens.fx = K[0], d.lens.fy = K[4], d.lens.cx = K[2], d.lens.cy = K[5];
    if (d.lens.fx == 0) return {};
    std::size_t expected = d.lens.distortion.size();
    if (model == "equidistant" || model == "fisheye") {
        d.model = "fisheye";
        expected = 4;
    } else if (model != "plumb_bob" && model != "rational_polynomial" && !distortion.empty()) {
        throw cdr.error("distortion model '" + model +
                        "' is not known; plumb_bob, rational_polynomial and equidistant are");
    }
    if (std::any_of(
            distortion.begin() + static_cast<std::ptrdiff_t>(std::min(expected, distortion.size())),
            distortion.end(), [](double k) { return k != 0; }))
        throw cdr.error("has more coefficients of distortion than " + std::to_string(expected));
    std::copy_n(distortion.begin(), std::min(expected, distortion.size()),
                d.lens.distortion.begin());
    return make_camera(d);
}

GpsMessage read_fix(Cdr& cdr, TimeNs t) {
    const auto status = cdr.number<std::int8_t>();
    cdr.number<std::uint16_t>();  // service
    const Eigen::Vector3d place = read_vector(cdr);
    // Alone 1, by a satellite's or a ground station's corrections 2, as NMEA counts.
    const int quality = status < 0 ? 0 : status == 0 ? 1 : 2;
    return {t, place.x(), place.y(), place.z(), quality};
}

Pose read_pose(Cdr& cdr, bool child_is_named) {
    if (child_is_named) cdr.text();
    return read_rigid(cdr);
}

std::vector<Ros2Transform> read_transforms(Cdr& cdr) {
    std::vector<Ros2Transform> all;
    for (auto count = cdr.number<std::uint32_t>(); count > 0; --count) {
        Ros2Transform transform;
        transform.parent = read_any_header(cdr).frame;
        transform.child = cdr.text();
        transform.T_parent_child = read_rigid(cdr);
        all.push_back(std::move(transform));
    }
    return all;
}

}  // namespace vio
