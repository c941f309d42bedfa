#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/program/command.h"

namespace mvstudio::cli {

/// Checks the value of every option of `app` and its subcommands by its type, beside the checks that the options have: numbers
/// are whole, finite and in range, counts are not negative, texts are not empty and are no forgotten value ("--out --json").
void CheckValues(CLI::App& app);

/// One of `names`, for options of a few words.
CLI::Validator OneOf(const std::vector<std::string>& names);

/// What was wrong with a command line that could not be parsed: an unknown command or flag is named with the nearest that there
/// is.
Notice ParseNotice(const CLI::App& app, const CLI::ParseError& error);

}  // namespace mvstudio::cli
