#include "libvio/ros2/bag.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "libvio/base/files.h"
#include "libvio/io/yaml_file.h"
#include "libvio/ros2/unpack.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

// One topic through all files of a bag.
class ChainedMessages final : public BagMessages {
 public:
    ChainedMessages(std::vector<std::shared_ptr<const BagFile>> files, std::string topic)
        : files_(std::move(files)), topic_(std::move(topic)) {}

    bool next() override {
        while (file_ < files_.size()) {
            if (!current_) current_ = files_[file_]->messages(topic_);
            if (current_ && current_->next()) {
                data_ = current_->data();
                // No message begins so that is not compressed.
                if (!is_zstd(data_)) return true;
                if (unpack_zstd(data_, unpacked_)) {
                    data_ = unpacked_.bytes();
                    return true;
                }
                left_out_.add("messages", current_->place() + ": its compressed data are damaged");
                continue;
            }
            if (current_) left_out_.add(current_->left_out());
            current_.reset();
            ++file_;
        }
        return false;
    }
    Bytes data() const override { return data_; }
    std::string place() const override { return current_->place(); }
    double progress() const override {
        return (static_cast<double>(file_) + (current_ ? current_->progress() : 0)) /
               static_cast<double>(files_.size());
    }

 private:
    std::vector<std::shared_ptr<const BagFile>> files_;
    std::string topic_;
    std::size_t file_ = 0;
    std::unique_ptr<BagMessages> current_;
    Unpacked unpacked_;
    Bytes data_;
};

std::unique_ptr<BagFile> open_file(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw InputError(path.string() + ": no such file; is the bag complete?");
    std::uint8_t bytes[8] = {};
    file.read(reinterpret_cast<char*>(bytes), sizeof bytes);
    if (is_zstd(bytes))
        throw InputError(path.string() +
                         ": was compressed whole; unpack it (zstd -d) and name the file that comes "
                         "out");
    if (std::memcmp(bytes, "SQLite", 6) == 0) return open_sqlite_bag(path.string());
    if (std::memcmp(bytes, "\x89MCAP", 5) == 0) return open_mcap_bag(path.string());
    throw InputError(path.string() +
                     ": is no file of a ROS 2 bag (.db3 or .mcap); name the bag's folder");
}

std::vector<fs::path> listed_files(const fs::path& folder) {
    const fs::path metadata = folder / "metadata.yaml";
    if (!is_there(metadata))
        throw InputError(folder.string() +
                         ": holds no metadata.yaml; name a ROS 2 bag's folder, or its .db3 or "
                         ".mcap file");
    const Yaml information = Yaml(metadata.string()).part("rosbag2_bagfile_information");
    std::vector<fs::path> files;
    for (const auto& name : information.get<std::vector<std::string>>("relative_file_paths")) {
        // ROS 2 Dashing wrote them relative to the folder above.
        const fs::path file = folder / name;
        files.push_back(is_there(file) ? file : folder / fs::path(name).filename());
    }
    if (files.empty()) throw information.error("relative_file_paths", "lists no files");
    return files;
}

}  // namespace

Ros2Bag::Ros2Bag(const std::string& path) : path_(path) {
    std::vector<fs::path> files = {path};
    if (is_folder(path)) files = listed_files(path);
    for (const fs::path& file : files) {
        files_.push_back(open_file(file));
        for (const BagTopic& topic : files_.back()->topics())
            if (!find(topic.name)) topics_.push_back(topic);
    }
    std::sort(topics_.begin(), topics_.end(),
              [](const BagTopic& a, const BagTopic& b) { return a.name < b.name; });
}

const BagTopic* Ros2Bag::find(const std::string& name) const {
    const auto found = std::find_if(topics_.begin(), topics_.end(),
                                    [&](const BagTopic& topic) { return topic.name == name; });
    return found == topics_.end() ? nullptr : &*found;
}

std::unique_ptr<BagMessages> Ros2Bag::messages(const std::string& topic) const {
    return std::make_unique<ChainedMessages>(files_, topic);
}

}  // namespace vio
