#include "libvio/ros2/ros2_import.h"

#include <algorithm>
#include <map>

#include "libvio/io/accelerometer_stream.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/image_depth.h"
#include "libvio/ros2/bag.h"
#include "libvio/ros2/messages.h"

namespace vio {
namespace {

using Types = std::vector<std::string>;

const Types kImageTypes = {"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"};
const Types kImuTypes = {"sensor_msgs/msg/Imu"};
const Types kFixTypes = {"sensor_msgs/msg/NavSatFix"};
// Where a child frame's name stands before the pose.
const Types kChildPoseTypes = {"geometry_msgs/msg/TransformStamped", "nav_msgs/msg/Odometry"};
const Types kPoseTypes = {"geometry_msgs/msg/PoseStamped",
                          "geometry_msgs/msg/PoseWithCovarianceStamped", kChildPoseTypes[0],
                          kChildPoseTypes[1]};

bool contains(const Types& types, const std::string& type) {
    return std::find(types.begin(), types.end(), type) != types.end();
}

std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
}

// One topic's messages with their headers, in order of time; all others are left out.
class StampedMessages {
 public:
    StampedMessages(const Ros2Bag& bag, const std::string& topic, LeftOutList& left_out)
        : topic_(topic), messages_(bag.messages(topic)), left_out_(left_out) {}

    bool next() {
        while (messages_->next()) {
            try {
                cdr_.emplace(messages_->data(), messages_->place());
                Ros2Header header = read_header(*cdr_);
                if (started_ && header.t <= header_.t)
                    throw cdr_->error("its stamp is not later than that of the message before");
                started_ = true;
                header_ = std::move(header);
                return true;
            } catch (const UnusableMeasurement& reason) {
                leave_out(reason);
            }
        }
        left_out_.add(messages_->left_out());
        return false;
    }
    const Ros2Header& header() const { return header_; }
    Cdr& body() { return *cdr_; }  ///< to be read once
    void leave_out(const UnusableMeasurement& reason) {
        left_out_.add("messages of " + topic_, reason.what());
    }
    double progress() const { return messages_->progress(); }
    InputError error(const std::string& problem) const {
        return InputError(messages_->place() + ": " + problem);
    }

 private:
    std::string topic_;
    std::unique_ptr<BagMessages> messages_;
    LeftOutList& left_out_;
    std::optional<Cdr> cdr_;
    Ros2Header header_;
    bool started_ = false;
};

// A topic as measurements: Read makes one of a message's body and stamp.
template <typename Read>
class TopicSource final : public MeasurementSource {
 public:
    TopicSource(const Ros2Bag& bag, const std::string& topic, Read read)
        : what_("messages of " + topic), messages_(bag, topic, left_out_), read_(std::move(read)) {}

    bool advance() override {
        if (!messages_.next()) return false;
        set_time(messages_.header().t, messages_);
        return true;
    }
    double progress() const override { return messages_.progress(); }

 private:
    const char* what() const override { return what_.c_str(); }
    Message message() override { return read_(messages_.body(), time()); }

    std::string what_;
    StampedMessages messages_;
    Read read_;
};

template <typename Read>
std::unique_ptr<MeasurementSource> topic_source(const Ros2Bag& bag, const std::string& topic,
                                                Read read) {
    return std::make_unique<TopicSource<Read>>(bag, topic, std::move(read));
}

// A gyro's readings with those of an accelerometer that is a topic of its own.
class GyroAndAccelSource final : public MeasurementSource {
 public:
    GyroAndAccelSource(const Ros2Bag& bag, const std::string& gyro, const std::string& accel)
        : gyro_(bag, gyro, left_out_),
          accel_(bag, accel, left_out_),
          stream_([this] { return next_accel(); }) {}

    bool advance() override {
        while (gyro_.next()) {
            try {
                reading_ = read_imu(gyro_.body(), gyro_.header().t);
            } catch (const UnusableMeasurement& reason) {
                gyro_.leave_out(reason);
                continue;
            }
            const auto accel = stream_.at(reading_.t);
            if (accel) {
                reading_.accel = *accel;
                set_time(reading_.t, gyro_);
                return true;
            }
            left_out_.add(kGyroAlone, gyro_.error("no acceleration near").what());
        }
        return false;
    }
    double progress() const override { return gyro_.progress(); }

 private:
    const char* what() const override { return "IMU readings"; }
    Message message() override { return reading_; }

    std::optional<AccelerometerStream::Reading> next_accel() {
        while (accel_.next()) {
            try {
                const ImuReading read = read_imu(accel_.body(), accel_.header().t);
                return {{read.t, read.accel}};
            } catch (const UnusableMeasurement& reason) {
                accel_.leave_out(reason);
            }
        }
        return {};
    }

    StampedMessages gyro_, accel_;
    AccelerometerStream stream_;
    ImuReading reading_;
};

// The topic that is meant; empty if none is named and the bag has none of these types.
std::string choose(const Ros2Bag& bag, const std::string& named, const Types& types,
                   const char* option) {
    std::vector<std::string> fitting;
    for (const BagTopic& topic : bag.topics())
        if (contains(types, topic.type)) fitting.push_back(topic.name);
    if (named.empty()) {
        if (fitting.size() > 1)
            throw InputError(bag.path() + ": has " + std::to_string(fitting.size()) +
                             " topics of " + listed(types) + " (" + listed(fitting) +
                             "); name one with " + option);
        return fitting.empty() ? "" : fitting[0];
    }
    const BagTopic* topic = bag.find(named);
    const std::string there = fitting.empty() ? "none is" : listed(fitting);
    if (!topic)
        throw InputError(bag.path() + ": has no topic " + named + "; of " + listed(types) + ": " +
                         there);
    if (!contains(types, topic->type))
        throw InputError(bag.path() + ": " + named + " is of type " + topic->type +
                         "; expected one of " + listed(types) + ": " + there);
    return named;
}

// The frame that a topic's first message names.
std::string frame_of(const Ros2Bag& bag, const std::string& topic) {
    LeftOutList left_out;
    StampedMessages messages(bag, topic, left_out);
    return messages.next() ? messages.header().frame : "";
}

// T_root_frame of every frame below a root that nothing holds.
class FrameTree {
 public:
    explicit FrameTree(const Ros2Bag& bag) {
        for (const auto messages = bag.messages("/tf_static"); messages->next();) {
            try {
                Cdr cdr(messages->data(), messages->place());
                for (const Ros2Transform& t : read_transforms(cdr)) above_[t.child] = t;
            } catch (const UnusableMeasurement&) {  // told if the place is then not found
            }
        }
    }

    std::optional<Pose> T_a_b(const std::string& a, const std::string& b) const {
        const auto [root_a, T_root_a] = to_root(a);
        const auto [root_b, T_root_b] = to_root(b);
        if (root_a != root_b) return {};
        return T_root_a.inverse() * T_root_b;
    }

 private:
    std::pair<std::string, Pose> to_root(std::string frame) const {
        Pose T_root_frame;
        // Frames that hold each other in a ring have no root.
        for (size_t steps = 0; steps <= above_.size(); ++steps) {
            const auto link = above_.find(frame);
            if (link == above_.end()) return {frame, T_root_frame};
            T_root_frame = link->second.T_parent_child * T_root_frame;
            frame = link->second.parent;
        }
        return {frame, T_root_frame};
    }

    std::map<std::string, Ros2Transform> above_;
};

// What the bag itself says of the camera: its intrinsics and its place on the IMU (B).
struct BagCalibration {
    CameraPtr camera;
    std::optional<Pose> T_B_C;
    std::vector<std::string> remarks;
};

// From the topic's first images; what is wrong with them is told when their turn comes.
BitDepth find_depth(const Ros2Bag& bag, const std::string& topic, cv::Mat (*read)(Cdr&),
                    int stated) {
    LeftOutList left_out;
    StampedMessages messages(bag, topic, left_out);
    return find_bit_depth(stated, [&]() -> cv::Mat {
        while (messages.next()) {
            try {
                return read(messages.body());
            } catch (const UnusableMeasurement&) {
            }
        }
        return {};
    });
}

void find_intrinsics(const Ros2Bag& bag, const std::string& image_topic, BagCalibration& found) {
    const bool compressed = bag.find(image_topic)->type == kImageTypes[1];
    const std::string image =
        compressed ? image_topic.substr(0, image_topic.find_last_of('/')) : image_topic;
    const size_t name = image.find_last_of('/') + 1;
    const std::string topic = image.substr(0, name) + "camera_info";
    const BagTopic* info = bag.find(topic);
    if (!info || info->type != "sensor_msgs/msg/CameraInfo") return;
    const bool rectified = image.compare(name, 10, "image_rect") == 0;
    LeftOutList left_out;
    StampedMessages messages(bag, topic, left_out);
    if (!messages.next()) return;
    try {
        found.camera = read_camera_info(messages.body(), rectified);
        if (found.camera)
            found.remarks.push_back("intrinsics of the camera: " + topic +
                                    (rectified ? ", of the rectified image" : ""));
    } catch (const InputError& reason) {
        found.remarks.push_back(std::string("intrinsics of the bag are not taken: ") +
                                reason.what());
    }
}

void find_extrinsics(const Ros2Bag& bag, const std::string& image_topic,
                     const std::string& imu_topic, BagCalibration& found) {
    const std::string camera = frame_of(bag, image_topic), imu = frame_of(bag, imu_topic);
    if (camera.empty() || imu.empty() || camera == imu) return;
    found.T_B_C = FrameTree(bag).T_a_b(imu, camera);
    if (found.T_B_C)
        found.remarks.push_back("place of the camera ('" + camera + "') on the IMU ('" + imu +
                                "'): /tf_static");
}

std::vector<TimedPose> read_truth(const Ros2Bag& bag, const std::string& topic,
                                  LeftOutList& left_out) {
    const bool child_is_named = contains(kChildPoseTypes, bag.find(topic)->type);
    StampedMessages messages(bag, topic, left_out);
    std::vector<TimedPose> poses;
    while (messages.next()) {
        try {
            poses.push_back({messages.header().t, read_pose(messages.body(), child_is_named)});
        } catch (const UnusableMeasurement& reason) {
            messages.leave_out(reason);
        }
    }
    return poses;
}

}  // namespace

ImportReport import_ros2(const std::string& bag_path, const std::string& out_rawlog,
                         const Ros2ImportOptions& options,
                         const std::function<void(double)>& progress) {
    const Ros2Bag bag(bag_path);
    const std::string images = choose(bag, options.image_topic, kImageTypes, "--image-topic");
    const std::string imu = choose(bag, options.imu_topic, kImuTypes, "--imu-topic");
    const std::string gps = choose(bag, options.gps_topic, kFixTypes, "--gps-topic");
    const std::string truth = options.truth_topic.empty()
                                  ? ""
                                  : choose(bag, options.truth_topic, kPoseTypes, "--truth-topic");
    if (images.empty() && imu.empty())
        throw InputError(bag.path() + ": has no topic of " + listed(kImageTypes) + " or " +
                         listed(kImuTypes));
    ImportReport report;
    Rig rig;
    bool placed = false;  // whether the bag says where the camera is
    MeasurementSources sources;
    if (!imu.empty() && !options.accel_topic.empty()) {
        const std::string accel = choose(bag, options.accel_topic, kImuTypes, "--accel-topic");
        sources.push_back(std::make_unique<GyroAndAccelSource>(bag, imu, accel));
        report.remarks.push_back("gyro: " + imu + ", accelerometer: " + accel);
    } else if (!imu.empty()) {
        sources.push_back(topic_source(bag, imu, read_imu));
        report.remarks.push_back("IMU: " + imu);
    }
    if (!gps.empty()) sources.push_back(topic_source(bag, gps, read_fix));
    if (!images.empty()) {
        const auto read =
            bag.find(images)->type == kImageTypes[1] ? read_compressed_image : read_image;
        const BitDepth found_depth = find_depth(bag, images, read, options.bit_depth);
        sources.push_back(
            topic_source(bag, images, [read, depth = found_depth](Cdr& body, TimeNs t) mutable {
                const cv::Mat image = read(body);
                try {
                    return ImageMessage{t, depth.to_8_bit(image)};
                } catch (const UnusableMeasurement& reason) {
                    throw body.error(reason.what());
                }
            }));
        report.remarks.push_back("images: " + images);
        if (const std::string remark = found_depth.remark(); !remark.empty())
            report.remarks.push_back(remark);
        BagCalibration found;
        find_intrinsics(bag, images, found);
        if (!imu.empty()) find_extrinsics(bag, images, imu, found);
        rig.camera = found.camera;
        rig.T_B_C = found.T_B_C.value_or(Pose());
        report.remarks.insert(report.remarks.end(), found.remarks.begin(), found.remarks.end());
        placed = found.T_B_C.has_value();
    }
    load_calibrations(options.calibration_files, rig);
    if (!images.empty() && !rig.camera)
        report.remarks.push_back(
            "the bag has no intrinsics of the camera; give them by --calibration, here or to run");
    if (!images.empty() && !imu.empty() && !placed && options.calibration_files.empty())
        report.remarks.push_back(
            "the bag does not say where the camera is on the IMU (/tf_static); give it by "
            "--calibration, here or to run");
    RawlogWriterOptions writer_options;
    writer_options.external_images = options.external_images;
    RawlogWriter writer(out_rawlog, rig, writer_options);
    merge_sources(std::move(sources), writer, report, progress);
    if (!truth.empty()) write_truth(out_rawlog, read_truth(bag, truth, report.left_out), report);
    writer.finish();
    return report;
}

}  // namespace vio
