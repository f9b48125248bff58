// Bags of ROS 2: topics and their serialised messages, from both storages.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libvio/ros2/cdr.h"

namespace vio {

struct BagTopic {
    std::string name;  ///< "/cam0/image_raw"
    std::string type;  ///< "sensor_msgs/msg/Image"
};

/// The messages of one topic, in the order in which they were recorded.
class BagMessages {
 public:
    virtual ~BagMessages() = default;

    /// Moves to the next message; false at the end. Throws InputError where the file cannot be
    /// read.
    virtual bool next() = 0;
    /// The message as it was serialised, valid until next().
    virtual Bytes data() const = 0;
    virtual std::string place() const = 0;  ///< "FILE (topic NAME, message N)"
    virtual double progress() const = 0;    ///< share of the topic's files done, 0 to 1
    const LeftOutList& left_out() const { return left_out_; }  ///< damaged stretches, so far

 protected:
    LeftOutList left_out_;
};

/// One file of a bag.
class BagFile {
 public:
    virtual ~BagFile() = default;

    virtual const std::vector<BagTopic>& topics() const = 0;
    virtual std::unique_ptr<BagMessages> messages(const std::string& topic) const = 0;
};

/// SQLite database (.db3), ROS 2's storage until Humble. Throws InputError for a file that is none.
std::unique_ptr<BagFile> open_sqlite_bag(const std::string& file);
/// MCAP (.mcap; https://mcap.dev/spec), that since Iron; chunks plain or compressed by LZ4 or
/// Zstandard. A file that was cut off holds what stands before; a damaged chunk is left out. Throws
/// InputError for a file that is none.
std::unique_ptr<BagFile> open_mcap_bag(const std::string& file);

/// A bag: a folder with metadata.yaml and the files that it lists, or one such file. Messages that
/// were compressed one by one (Zstandard) are unpacked; files that were compressed whole are not
/// read.
class Ros2Bag {
 public:
    /// Throws InputError for what is no such bag.
    explicit Ros2Bag(const std::string& path);

    const std::string& path() const { return path_; }
    /// Of all files, by name.
    const std::vector<BagTopic>& topics() const { return topics_; }
    /// Null if no topic is named so.
    const BagTopic* find(const std::string& name) const;
    std::unique_ptr<BagMessages> messages(const std::string& topic) const;

 private:
    std::string path_;
    std::vector<std::shared_ptr<const BagFile>> files_;
    std::vector<BagTopic> topics_;
};

}  // namespace vio
