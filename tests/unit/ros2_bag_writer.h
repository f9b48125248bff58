// Made bags of ROS 2: messages in CDR, in SQLite or MCAP.
#pragma once

#include <lz4frame.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "libvio/base/types.h"

namespace vio::test {

using Blob = std::vector<std::uint8_t>;

/// A message, value by value.
class CdrWriter {
 public:
    explicit CdrWriter(bool big_endian = false)
        : big_endian_(big_endian), bytes_{0, std::uint8_t(big_endian ? 0 : 1), 0, 0} {}

    template <typename Number>
    CdrWriter& operator<<(Number value) {
        static_assert(std::is_arithmetic_v<Number>);
        while ((bytes_.size() - 4) % sizeof value) bytes_.push_back(0);
        std::uint8_t raw[sizeof value];
        std::memcpy(raw, &value, sizeof value);
        for (std::size_t i = 0; i < sizeof value; ++i)
            bytes_.push_back(raw[big_endian_ ? sizeof value - 1 - i : i]);
        return *this;
    }
    CdrWriter& operator<<(const std::string& text) {
        *this << static_cast<std::uint32_t>(text.size() + 1);
        bytes_.insert(bytes_.end(), text.begin(), text.end());
        bytes_.push_back(0);
        return *this;
    }
    CdrWriter& operator<<(const char* text) { return *this << std::string(text); }
    CdrWriter& operator<<(const Blob& blob) {
        *this << static_cast<std::uint32_t>(blob.size());
        bytes_.insert(bytes_.end(), blob.begin(), blob.end());
        return *this;
    }
    CdrWriter& header(TimeNs t, const char* frame) {
        return *this << static_cast<std::int32_t>(t / 1'000'000'000)
                     << static_cast<std::uint32_t>(t % 1'000'000'000) << frame;
    }
    template <typename... Numbers>
    CdrWriter& doubles(Numbers... values) {
        return (*this << ... << static_cast<double>(values));
    }
    CdrWriter& zeros(int count) {
        while (count-- > 0) *this << 0.0;
        return *this;
    }
    const Blob& bytes() const { return bytes_; }

 private:
    bool big_endian_;
    Blob bytes_;
};

struct BagMessage {
    std::string topic, type;
    Blob data;
};

/// As rosbag2 lays it out since Foxy.
inline void write_sqlite_bag(const std::string& file, const std::vector<BagMessage>& messages) {
    sqlite3* db = nullptr;
    sqlite3_open(file.c_str(), &db);
    sqlite3_exec(
        db,
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
        " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);",
        nullptr, nullptr, nullptr);
    const auto run = [&](const char* text, auto bind) {
        sqlite3_stmt* statement = nullptr;
        sqlite3_prepare_v2(db, text, -1, &statement, nullptr);
        bind(statement);
        sqlite3_step(statement);
        sqlite3_finalize(statement);
    };
    std::map<std::string, int> ids;
    int count = 0;
    for (const BagMessage& m : messages) {
        if (ids.emplace(m.topic, ids.size() + 1).second)
            run("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", [&](sqlite3_stmt* s) {
                sqlite3_bind_int(s, 1, ids[m.topic]);
                sqlite3_bind_text(s, 2, m.topic.c_str(), -1, SQLITE_STATIC);
                sqlite3_bind_text(s, 3, m.type.c_str(), -1, SQLITE_STATIC);
            });
        run("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
            [&](sqlite3_stmt* s) {
                sqlite3_bind_int(s, 1, ids[m.topic]);
                sqlite3_bind_int64(s, 2, ++count);
                sqlite3_bind_blob(s, 3, m.data.data(), static_cast<int>(m.data.size()),
                                  SQLITE_STATIC);
            });
    }
    sqlite3_close(db);
}

inline Blob zstd_packed(const Blob& plain) {
    Blob packed(ZSTD_compressBound(plain.size()));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 1));
    return packed;
}

/// Of records; little-endian.
class McapWriter {
 public:
    template <typename Number>
    McapWriter& number(Number value) {
        for (std::size_t i = 0; i < sizeof value; ++i)
            bytes_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
        return *this;
    }
    McapWriter& text(const std::string& text) {
        number(static_cast<std::uint32_t>(text.size()));
        bytes_.insert(bytes_.end(), text.begin(), text.end());
        return *this;
    }
    McapWriter& raw(const Blob& blob) {
        bytes_.insert(bytes_.end(), blob.begin(), blob.end());
        return *this;
    }
    McapWriter& record(std::uint8_t kind, const McapWriter& content) {
        bytes_.push_back(kind);
        return number(static_cast<std::uint64_t>(content.bytes_.size())).raw(content.bytes_);
    }
    const Blob& bytes() const { return bytes_; }

 private:
    Blob bytes_;
};

/// `compression`: "none" (no chunks), "" (chunks as they are), "lz4" or "zstd"; chunks of three
/// messages. Where they begin goes to chunk_starts.
inline void write_mcap_bag(const std::string& file, const std::vector<BagMessage>& messages,
                           const std::string& compression,
                           std::vector<std::size_t>* chunk_starts = nullptr) {
    const std::string magic("\x89MCAP0\r\n", 8);
    McapWriter out;
    out.raw({magic.begin(), magic.end()}).record(0x01, McapWriter().text("ros2").text("made"));
    std::map<std::string, std::uint16_t> channels;
    McapWriter channel_records, chunk;
    int in_chunk = 0;
    const auto end_chunk = [&] {
        if (compression == "none" || in_chunk == 0) {
            out.raw(chunk.bytes());
        } else {
            Blob packed = chunk.bytes();
            if (compression == "zstd") packed = zstd_packed(packed);
            if (compression == "lz4") {
                packed.resize(LZ4F_compressFrameBound(packed.size(), nullptr));
                packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), chunk.bytes().data(),
                                                 chunk.bytes().size(), nullptr));
            }
            if (chunk_starts) chunk_starts->push_back(out.bytes().size());
            out.record(0x06, McapWriter()
                                 .number(std::uint64_t{1})
                                 .number(std::uint64_t{2})
                                 .number(static_cast<std::uint64_t>(chunk.bytes().size()))
                                 .number(static_cast<std::uint32_t>(
                                     crc32_z(0, chunk.bytes().data(), chunk.bytes().size())))
                                 .text(compression)
                                 .number(static_cast<std::uint64_t>(packed.size()))
                                 .raw(packed));
            out.record(0x07, McapWriter().number(std::uint16_t{1}).number(std::uint32_t{0}));
        }
        chunk = {};
        in_chunk = 0;
    };
    std::uint32_t sequence = 0;
    for (const BagMessage& m : messages) {
        const auto id = static_cast<std::uint16_t>(channels.size() + 1);
        if (channels.emplace(m.topic, id).second) {
            McapWriter both;
            both.record(0x03, McapWriter().number(id).text(m.type).text("ros2msg").text("no text"));
            both.record(0x04, McapWriter().number(id).number(id).text(m.topic).text("cdr").number(
                                  std::uint32_t{0}));
            chunk.raw(both.bytes());
            channel_records.raw(both.bytes());
        }
        ++sequence;
        chunk.record(0x05, McapWriter()
                               .number(channels[m.topic])
                               .number(sequence)
                               .number(std::uint64_t{sequence})
                               .number(std::uint64_t{sequence})
                               .raw(m.data));
        if (++in_chunk == 3) end_chunk();
    }
    end_chunk();
    out.record(0x0f, McapWriter().number(std::uint32_t{0}));
    const auto summary = static_cast<std::uint64_t>(out.bytes().size());
    out.raw(channel_records.bytes());
    out.record(0x02,
               McapWriter().number(summary).number(std::uint64_t{0}).number(std::uint32_t{0}));
    out.raw({magic.begin(), magic.end()});
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(out.bytes().data()),
               static_cast<std::streamsize>(out.bytes().size()));
}

}  // namespace vio::test
