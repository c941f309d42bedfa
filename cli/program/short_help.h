#pragma once

#include <CLI/CLI.hpp>

namespace mvstudio::cli {

/// `--help` of a command with many options shows those that most runs need, `--help-all` every one. To be called when all
/// commands are there.
void ShortenHelp(CLI::App& app);

}  // namespace mvstudio::cli
