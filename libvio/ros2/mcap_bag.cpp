#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>

#include "libvio/ros2/bag.h"
#include "libvio/ros2/unpack.h"

namespace vio {
namespace {

// A record is its kind (one byte), the length of its content (eight) and that.
enum Kind : std::uint8_t {
    kFooter = 0x02,
    kSchema = 0x03,
    kChannel = 0x04,
    kMessage = 0x05,
    kChunk = 0x06,
    kDataEnd = 0x0f
};
constexpr std::uint64_t kMagicSize = 8, kRecordHeader = 9, kFooterContent = 20;

class Malformed {};

// The fields of a record; little-endian. Throws Malformed where it ends too early.
class Fields {
 public:
    explicit Fields(Bytes content) : content_(content) {}

    template <typename Number>
    Number number() {
        std::uint64_t value = 0;
        const Bytes raw = take(sizeof(Number));
        for (std::size_t i = raw.size(); i-- > 0;) value = value << 8 | raw[i];
        return static_cast<Number>(value);
    }
    std::string text() {
        const Bytes raw = take(number<std::uint32_t>());
        return {raw.begin(), raw.end()};
    }
    Bytes take(std::uint64_t count) {
        if (count > content_.size()) throw Malformed();
        const Bytes taken = content_.first(count);
        content_ = content_.subspan(count);
        return taken;
    }
    Bytes rest() const { return content_; }

 private:
    Bytes content_;
};

struct Record {
    std::uint8_t kind = 0;
    Bytes content;  ///< valid until the next one is read
};

// The data section's schemas, channels and messages, those in chunks in their place.
class Records {
 public:
    // `reader`: what they are read for, in what is left out.
    Records(const std::string& path, std::string reader)
        : path_(path),
          reader_(std::move(reader)),
          file_(path, std::ios::binary),
          size_(std::filesystem::file_size(path)) {
        seek(kMagicSize);
    }

    bool next(Record& record) {
        for (;;) {
            if (!chunk_.empty()) {
                if (next_in_chunk(record)) return true;
                continue;
            }
            std::uint64_t length = 0;
            if (!next_header(record.kind, length)) return false;
            if (record.kind == kDataEnd || record.kind == kFooter) return false;
            if (record.kind < kSchema || record.kind > kChunk) {
                seek(at_ + length);
                continue;
            }
            buffer_.resize(length);
            file_.read(reinterpret_cast<char*>(buffer_.data()),
                       static_cast<std::streamsize>(length));
            if (!file_) throw InputError(place() + ": cannot be read");
            at_ += length;
            record.content = buffer_;
            if (record.kind != kChunk) return true;
            if (!unpack(record.content)) leave_out("chunks", "the chunk is damaged");
        }
    }
    // To records that begin at a byte of the file.
    void seek(std::uint64_t byte) {
        at_ = byte;
        file_.seekg(static_cast<std::streamoff>(byte));
    }
    double progress() const { return static_cast<double>(at_) / static_cast<double>(size_); }
    std::uint64_t size() const { return size_; }
    LeftOutList left_out;

 private:
    std::string place() const { return path_ + " (byte " + std::to_string(at_) + ")"; }
    void leave_out(const char* what, const std::string& problem) {
        left_out.add(what + (", read for " + reader_), place() + ": " + problem);
    }

    bool next_header(std::uint8_t& kind, std::uint64_t& length) {
        std::uint8_t bytes[kRecordHeader] = {};
        const bool whole = at_ + kRecordHeader <= size_ &&
                           file_.read(reinterpret_cast<char*>(bytes), kRecordHeader);
        Fields header(bytes);
        kind = header.number<std::uint8_t>();
        length = header.number<std::uint64_t>();
        if (!whole || length > size_ - at_ - kRecordHeader) {
            leave_out("ends", "the file is cut off; what stands before is kept");
            return false;
        }
        at_ += kRecordHeader;
        return true;
    }

    bool next_in_chunk(Record& record) {
        try {
            Fields fields(chunk_);
            record.kind = fields.number<std::uint8_t>();
            record.content = fields.take(fields.number<std::uint64_t>());
            chunk_ = fields.rest();
            return record.kind >= kSchema && record.kind <= kMessage;
        } catch (const Malformed&) {
            chunk_ = {};
            leave_out("chunks", "the chunk's records are damaged");
            return false;
        }
    }

    bool unpack(Bytes content) {
        try {
            Fields fields(content);
            fields.take(16);  // first and last time
            const auto size = fields.number<std::uint64_t>();
            const auto checksum = fields.number<std::uint32_t>();
            const std::string compression = fields.text();
            const Bytes packed = fields.take(fields.number<std::uint64_t>());
            if (compression.empty())
                chunk_ = packed;
            else if (compression == "lz4"
                         ? unpack_lz4(packed, unpacked_, size)
                         : compression == "zstd" && unpack_zstd(packed, unpacked_, size))
                chunk_ = unpacked_.bytes();
            else
                return false;
            if (checksum == 0 || checksum == crc32_z(0, chunk_.data(), chunk_.size())) return true;
        } catch (const Malformed&) {
        }
        chunk_ = {};
        return false;
    }

    std::string path_, reader_;
    std::ifstream file_;
    std::uint64_t size_ = 0, at_ = 0;
    std::vector<std::uint8_t> buffer_;
    Unpacked unpacked_;
    Bytes chunk_;  // what is still to be read of it
};

struct Channel {
    std::uint16_t id = 0, schema = 0;
    std::string topic, encoding;
};

Channel read_channel(Bytes content) {
    Fields fields(content);
    Channel channel;
    channel.id = fields.number<std::uint16_t>();
    channel.schema = fields.number<std::uint16_t>();
    channel.topic = fields.text();
    channel.encoding = fields.text();
    return channel;
}

class McapMessages final : public BagMessages {
 public:
    McapMessages(const std::string& path, const std::string& topic)
        : path_(path), topic_(topic), records_(path, topic) {}

    bool next() override {
        Record record;
        while (records_.next(record)) try {
                if (record.kind == kChannel) {
                    const Channel channel = read_channel(record.content);
                    is_ours_[channel.id] = channel.topic == topic_ && channel.encoding == "cdr";
                } else if (record.kind == kMessage) {
                    Fields fields(record.content);
                    if (!is_ours_[fields.number<std::uint16_t>()]) continue;
                    fields.take(20);  // sequence, times of recording and publishing
                    data_ = fields.rest();
                    ++count_;
                    return true;
                }
            } catch (const Malformed&) {
                left_out_.add("records", path_ + ": a record is too short");
            }
        left_out_.add(records_.left_out);
        return false;
    }
    Bytes data() const override { return data_; }
    std::string place() const override {
        return path_ + " (topic " + topic_ + ", message " + std::to_string(count_) + ")";
    }
    double progress() const override { return records_.progress(); }

 private:
    std::string path_, topic_;
    Records records_;
    std::map<std::uint16_t, bool> is_ours_;
    Bytes data_;
    int count_ = 0;
};

class McapBag final : public BagFile {
 public:
    explicit McapBag(const std::string& path) : path_(path) {
        Records records(path, "its topics");
        if (const auto summary = find_summary(path)) {
            records.seek(*summary);
            read_topics(records);
        }
        if (!topics_.empty()) return;
        records.seek(kMagicSize);
        read_topics(records);
    }
    const std::vector<BagTopic>& topics() const override { return topics_; }
    std::unique_ptr<BagMessages> messages(const std::string& topic) const override {
        return std::make_unique<McapMessages>(path_, topic);
    }

 private:
    // Where the summary begins, in which channels stand once more; a file that was cut off has
    // none.
    static std::optional<std::uint64_t> find_summary(const std::string& path) {
        const std::uint64_t size = std::filesystem::file_size(path);
        constexpr std::uint64_t kEnd = kRecordHeader + kFooterContent + kMagicSize;
        if (size < kMagicSize + kEnd) return {};
        std::ifstream file(path, std::ios::binary);
        file.seekg(static_cast<std::streamoff>(size - kEnd));
        std::uint8_t bytes[kEnd] = {};
        if (!file.read(reinterpret_cast<char*>(bytes), kEnd)) return {};
        Fields fields(bytes);
        const bool is_footer = fields.number<std::uint8_t>() == kFooter &&
                               fields.number<std::uint64_t>() == kFooterContent;
        const auto start = fields.number<std::uint64_t>();
        if (!is_footer || start < kMagicSize || start > size - kEnd) return {};
        return start;
    }

    void read_topics(Records& records) {
        std::map<std::uint16_t, std::string> types;
        Record record;
        while (records.next(record)) try {
                if (record.kind == kSchema) {
                    Fields fields(record.content);
                    const auto id = fields.number<std::uint16_t>();
                    types[id] = fields.text();
                } else if (record.kind == kChannel) {
                    const Channel channel = read_channel(record.content);
                    const bool known =
                        std::any_of(topics_.begin(), topics_.end(),
                                    [&](const BagTopic& t) { return t.name == channel.topic; });
                    if (!known && channel.encoding == "cdr")
                        topics_.push_back({channel.topic, types[channel.schema]});
                }
            } catch (const Malformed&) {  // is told where messages are read
            }
    }

    std::string path_;
    std::vector<BagTopic> topics_;
};

}  // namespace

std::unique_ptr<BagFile> open_mcap_bag(const std::string& file) {
    return std::make_unique<McapBag>(file);
}

}  // namespace vio
