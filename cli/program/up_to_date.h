#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/program/run_line.h"
#include "core/disk/trace.h"

/// Whether a command line that was run before would make what is there already.
namespace mvstudio::cli {

/// A command line without what changes no result: how paths are written, in which order options are typed, how much is printed.
struct TypedLine {
  std::string key;                 ///< digest of the command, the version, seed, threads and options
  std::vector<std::string> named;  ///< absolute paths that are there and are no outputs
};

TypedLine TypedLineOf(const Registry::Entry& entry, const GlobalOptions& global);

/// What provenance keeps, so that EarlierResult knows the line again: its key, what it read and what it wrote. Null where that
/// cannot be judged later: the line failed, its files are named by nobody (--redact), links or pipes were read, an input
/// changed after `begun_ns` (since 1970).
nlohmann::ordered_json RecordOfLine(const Registry::Entry& entry, const GlobalOptions& global, const CommandResult& result,
                                    const DiskTrace& trace, int64_t begun_ns);

/// The result of the run that wrote `path`, where that was of the same line, every file that it read has its content still, and
/// so has every file that it wrote, without more or less of them in folders that it wrote as a whole. Never throws.
std::optional<CommandResult> EarlierResult(const Registry::Entry& entry, const GlobalOptions& global, const std::string& path);

}  // namespace mvstudio::cli
