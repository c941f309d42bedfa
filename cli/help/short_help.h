#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace mvstudio::cli {

/// Shows of a flag that may be on or off what changes its default: `--png` or `--no-masks`. To be called before the commands
/// are there, which take it over.
void UsePlainFlags(CLI::App& app);

/// A command by its words, "calib show"; null: there is none.
CLI::App* CommandNamed(CLI::App& app, const std::string& words);

/// `--help` of a command with many options shows those that most runs need, `--help-all` every one. To be called when all
/// commands are there.
void ShortenHelp(CLI::App& app);

}  // namespace mvstudio::cli
