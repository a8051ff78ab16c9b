// A database of SQLite from elsewhere: its tables row by row, with nothing in it run. Only where the build has the
// library (LIESTAT_HAS_SQLITE_LIBRARY).
#pragma once

#include <formats/detail/bag_file.hpp>
#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>
#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace liestat::detail {

/// A database that is only read, unless it is made anew.
class SqliteFile {
 public:
  /// Opens a file; throws InputError where it cannot be opened.
  SqliteFile(const std::string& path, std::string name) : name_(std::move(name)) {
    std::string uri = "file:";
    for (const char c : path) {
      if (c == '?' || c == '#' || c == '%') {
        uri += fmt::format("%{:02X}", static_cast<unsigned>(c));
      } else {
        uri += c;
      }
    }
    std::error_code ignored;
    // Where a writer left no log behind, nothing need be written beside a file to read it.
    const bool log = std::filesystem::file_size(path + "-wal", ignored) > 0 && !ignored;
    uri += log ? "?mode=ro" : "?mode=ro&immutable=1";
    open(uri, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
    const std::uintmax_t bytes = std::filesystem::file_size(path, ignored);
    if (!ignored) most_rows_ = bytes + 1000;
  }
  /// A copy of a database at a path where there is no file yet.
  SqliteFile(const SqliteFile& original, const std::string& path) : name_(sourceName(path)) {
    open(path, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
    sqlite3_backup* const backup = sqlite3_backup_init(database_, "main", original.database_, "main");
    if (backup != nullptr) {
      sqlite3_backup_step(backup, -1);
      sqlite3_backup_finish(backup);
    }
    if (sqlite3_errcode(database_) != SQLITE_OK) fail("a database and room for its copy");
    run("PRAGMA journal_mode=DELETE");
  }
  ~SqliteFile() { sqlite3_close(database_); }
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  const std::string& name() const { return name_; }
  /// The last error, in SQLite's words.
  std::string message() const { return database_ == nullptr ? "no memory" : sqlite3_errmsg(database_); }

  /// Calls a function with each row; false, with message(), if the rows end with an error. All rows together that are
  /// read are no more than the file has bytes, so that a table which leads back into itself ends with an InputError.
  template <class Row>
  bool each(const char* sql, sqlite3_int64 parameter, Row&& row) const {
    Statement s = prepared(sql);
    if (!s) return false;
    sqlite3_bind_int64(s.get(), 1, parameter);
    int result = 0;
    for (; (result = sqlite3_step(s.get())) == SQLITE_ROW; row(s.get())) {
      if (++rows_ > most_rows_) throw InputError(name_, 0, "a table leads back into itself", "rows that have an end");
    }
    return result == SQLITE_DONE;
  }
  /// Runs statements that have no rows; throws InputError.
  void run(const char* sql) {
    if (sqlite3_exec(database_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) fail("");
  }

  using Statement = std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)>;
  /// A compiled statement; null with message() where there is an error.
  Statement prepared(const char* sql) const {
    sqlite3_stmt* s = nullptr;
    sqlite3_prepare_v2(database_, sql, -1, &s, nullptr);
    return {s, &sqlite3_finalize};
  }

  /// True if all of these are tables, none with generated columns; a view may run for ever. `names`: 'a','b'.
  bool hasTables(const std::string& names, int count) const {
    int tables = 0, generated = 0;
    each(("SELECT count(*) FROM sqlite_schema WHERE type='table' AND name IN (" + names +
          ") AND sql LIKE 'create table%'")
             .c_str(),
         0, [&](sqlite3_stmt* s) { tables = sqlite3_column_int(s, 0); });
    each(("SELECT count(*) FROM sqlite_schema t, pragma_table_xinfo(t.name) WHERE hidden<>0 AND t.name IN (" + names +
          ")")
             .c_str(),
         0, [&](sqlite3_stmt* s) { generated = sqlite3_column_int(s, 0); });
    return tables == count && generated == 0;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError(name_, 0, "SQLite: " + printable(message(), 80), expected);
  }

  static std::string text(sqlite3_stmt* s, int column) {
    const auto* t = reinterpret_cast<const char*>(sqlite3_column_text(s, column));
    return t == nullptr ? "" : t;
  }
  static std::string_view blob(sqlite3_stmt* s, int column) {
    const auto* data = static_cast<const char*>(sqlite3_column_blob(s, column));
    return data == nullptr ? std::string_view()
                           : std::string_view(data, static_cast<std::size_t>(sqlite3_column_bytes(s, column)));
  }

 private:
  void open(const std::string& file, int flags) {
    if (sqlite3_open_v2(file.c_str(), &database_, flags, nullptr) != SQLITE_OK) {
      const std::string why = message();
      sqlite3_close(database_);
      throw InputError(name_, 0, "SQLite: " + why, "a database");
    }
    sqlite3_limit(database_, SQLITE_LIMIT_LENGTH, static_cast<int>(largest_chunk));
    sqlite3_db_config(database_, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
    sqlite3_exec(database_, "PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON", nullptr, nullptr, nullptr);
  }

  sqlite3* database_ = nullptr;
  std::string name_;
  std::uint64_t most_rows_ = 1000;
  mutable std::uint64_t rows_ = 0;
};

}  // namespace liestat::detail
