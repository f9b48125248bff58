#include <sqlite3.h>

#include <map>

#include "libvio/ros2/bag.h"

namespace vio {
namespace {

struct Close {
    void operator()(sqlite3* database) const { sqlite3_close(database); }
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, Close>;

// One query and its rows.
class Query {
 public:
    Query(sqlite3* database, const std::string& file, const char* text)
        : database_(database), file_(file) {
        sqlite3_stmt* statement = nullptr;
        const int code = sqlite3_prepare_v2(database, text, -1, &statement, nullptr);
        statement_.reset(statement);
        if (code != SQLITE_OK) throw error();
    }
    void bind(int index, std::int64_t value) { sqlite3_bind_int64(statement_.get(), index, value); }
    bool next() {
        const int code = sqlite3_step(statement_.get());
        if (code != SQLITE_ROW && code != SQLITE_DONE) throw error();
        return code == SQLITE_ROW;
    }
    std::int64_t integer(int column) const {
        return sqlite3_column_int64(statement_.get(), column);
    }
    Bytes blob(int column) const {
        const void* data = sqlite3_column_blob(statement_.get(), column);
        const int size = sqlite3_column_bytes(statement_.get(), column);
        return {static_cast<const std::uint8_t*>(data), static_cast<std::size_t>(data ? size : 0)};
    }
    std::string text(int column) const {
        const Bytes raw = blob(column);
        return {raw.begin(), raw.end()};
    }

 private:
    InputError error() const {
        return InputError(file_ + ": cannot be read as a ROS 2 bag's database (" +
                          sqlite3_errmsg(database_) + "); was it copied whole?");
    }

    sqlite3* database_;
    std::string file_;
    std::unique_ptr<sqlite3_stmt, Close> statement_;
};

// Every reader has a connection of its own: it may outlive the others.
Database connect(const std::string& file) {
    sqlite3* handle = nullptr;
    const int code = sqlite3_open_v2(file.c_str(), &handle, SQLITE_OPEN_READONLY, nullptr);
    Database database(handle);
    if (code != SQLITE_OK)
        throw InputError(file + ": cannot be opened (" + sqlite3_errstr(code) + ")");
    return database;
}

class SqliteMessages final : public BagMessages {
 public:
    SqliteMessages(std::string file, std::string topic, std::int64_t id)
        : file_(std::move(file)),
          topic_(std::move(topic)),
          database_(connect(file_)),
          // In the order of recording, which needs no index.
          rows_(database_.get(), file_,
                "SELECT id, data FROM messages WHERE topic_id = ? ORDER BY id") {
        rows_.bind(1, id);
        Query last(database_.get(), file_, "SELECT max(id) FROM messages");
        if (last.next()) last_ = last.integer(0);
    }
    bool next() override { return rows_.next(); }
    Bytes data() const override { return rows_.blob(1); }
    std::string place() const override {
        return file_ + " (topic " + topic_ + ", message " + std::to_string(rows_.integer(0)) + ")";
    }
    double progress() const override {
        return last_ > 0 ? static_cast<double>(rows_.integer(0)) / static_cast<double>(last_) : 0;
    }

 private:
    std::string file_, topic_;
    Database database_;
    Query rows_;
    std::int64_t last_ = 0;
};

class SqliteBag final : public BagFile {
 public:
    explicit SqliteBag(const std::string& file) : file_(file) {
        const Database database = connect(file);
        Query rows(database.get(), file, "SELECT id, name, type FROM topics");
        while (rows.next()) {
            topics_.push_back({rows.text(1), rows.text(2)});
            ids_.emplace(topics_.back().name, rows.integer(0));
        }
    }
    const std::vector<BagTopic>& topics() const override { return topics_; }
    std::unique_ptr<BagMessages> messages(const std::string& topic) const override {
        const auto id = ids_.find(topic);
        if (id == ids_.end()) return nullptr;
        return std::make_unique<SqliteMessages>(file_, topic, id->second);
    }

 private:
    std::string file_;
    std::vector<BagTopic> topics_;
    std::map<std::string, std::int64_t> ids_;
};

}  // namespace

std::unique_ptr<BagFile> open_sqlite_bag(const std::string& file) {
    return std::make_unique<SqliteBag>(file);
}

}  // namespace vio
