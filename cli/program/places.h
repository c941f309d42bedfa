#pragma once

#include "cli/program/command.h"

namespace CLI {
class Option;
}

namespace mvstudio::cli {

/// Names of the checks that mark options of outputs: files, and folders or either.
constexpr char kFileMark[] = "output file", kPlaceMark[] = "output";

/// Whether the option has one of these marks.
bool IsOutput(CLI::Option* option);

/// Before a command begins: what it is to write can be written there. Hours of work are not to end at a file of somebody else,
/// an older result, a folder that cannot be written or a full disk. Throws UsageError, IoError, ResourceError.
void CheckPlaces(const Registry::Entry& entry);

}  // namespace mvstudio::cli
