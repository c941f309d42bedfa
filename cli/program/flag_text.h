#pragma once

#include <string>

#include "cli/program/command.h"

/// Libraries name an option by its field, `option 'frames'`; who types a command line reads `--frames`.
namespace mvstudio::cli {

/// `text` with flags in place of options' names, and with short forms of absurdly long numbers.
std::string WithFlags(const std::string& text);
/// The same in everything that a result says.
CommandResult NamedFlags(CommandResult result);

}  // namespace mvstudio::cli
