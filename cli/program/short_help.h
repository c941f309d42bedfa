#pragma once

#include <CLI/CLI.hpp>

namespace mvstudio::cli {

/// Shows of a flag that may be on or off what changes its default: `--png` or `--no-masks`. To be called before the commands
/// are there, which take it over.
void UsePlainFlags(CLI::App& app);

/// `--help` of a command with many options shows those that most runs need, `--help-all` every one. To be called when all
/// commands are there.
void ShortenHelp(CLI::App& app);

}  // namespace mvstudio::cli
