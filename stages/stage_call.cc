#include "stages/stage_call.h"

#include "core/join.h"

namespace mvstudio::stages {

std::vector<std::string> CommandLine::Words() const {
  std::vector<std::string> words = command;
  for (const LineOption& option : options) {
    const std::string flag = "--" + option.name;
    if (option.values.empty()) words.push_back(flag);
    for (const std::string& value : option.values) words.insert(words.end(), {flag, value});
  }
  words.insert(words.end(), typed.begin(), typed.end());
  return words;
}

std::string CommandLine::Text() const { return "mvstudio " + Join(Words(), " "); }

}  // namespace mvstudio::stages
