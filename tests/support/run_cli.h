#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/sanitized.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::testing {

struct CliRun {
  int exit = -1;
  std::string out, err;
  /// stdout as JSON; a discarded value when it is not exactly one object.
  nlohmann::json Json() const { return nlohmann::json::parse(out, nullptr, false); }
};

inline std::string Slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// The words between white space.
inline std::vector<std::string> WordsOf(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}

inline std::string ShellQuote(const std::string& word) {
  std::string quoted = "'";
  for (char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

inline bool Mentions(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }

/// Path of the program under test: MVSTUDIO_BIN, as ctest sets it.
inline std::string CliPath() {
  const char* path = std::getenv("MVSTUDIO_BIN");
  return path ? path : "build/release/bin/mvstudio";
}

/// Runs `PROGRAM WORDS…`; `prefix` is put before the command in the shell (ulimit, environment).
inline CliRun RunProgram(const std::string& program, const std::vector<std::string>& words, const std::string& prefix = "") {
  TempDir folder;
  std::string line = prefix + ShellQuote(program);
  for (const std::string& word : words) line += " " + ShellQuote(word);
  line += " >" + ShellQuote(folder.path() + "/out") + " 2>" + ShellQuote(folder.path() + "/err") + " </dev/null";
  const int status = std::system(line.c_str());
  const CliRun run{WIFEXITED(status) ? WEXITSTATUS(status) : -1, Slurp(folder.path() + "/out"), Slurp(folder.path() + "/err")};
  // ctest looks for reports of sanitizers in what a test prints: one that expects a failure would otherwise swallow them.
  if (kSanitized && (Mentions(run.err, "Sanitizer") || Mentions(run.err, "runtime error"))) std::cerr << run.err;
  return run;
}

inline CliRun RunCli(const std::vector<std::string>& words, const std::string& prefix = "") {
  return RunProgram(CliPath(), words, prefix);
}

}  // namespace mvstudio::testing
