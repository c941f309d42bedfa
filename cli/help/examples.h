#pragma once

#include <CLI/CLI.hpp>

namespace mvstudio::cli {

/// Ends the help of every command with a line that works, with names of files in place of the user's own.
void AddExamples(CLI::App& app);

}  // namespace mvstudio::cli
