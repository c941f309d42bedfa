#pragma once

#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <string>

/// Programs that are timed in turns with a peer: one request a line on standard input, one line of answer each.
namespace mvstudio::bench {

/// What each first word does with the rest of its line. It prints its answer.
using Requests = std::map<std::string, std::function<void(std::istringstream&)>>;

/// Answers until the input ends. The exit code: 2 for an unknown word, 1 when a request fails, with a message.
inline int Answer(const char* program, const Requests& requests) try {
  for (std::string line, word; std::getline(std::cin, line);) {
    std::istringstream words(line);
    words >> word;
    const auto found = requests.find(word);
    if (found == requests.end()) {
      std::fprintf(stderr, "%s: unknown request: %s\n", program, line.c_str());
      return 2;
    }
    found->second(words);
    std::fflush(stdout);
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s: %s\n", program, error.what());
  return 1;
}

/// Prints "VALUE SECONDS CPU_SECONDS" of work that gives a number.
template <class Work>
void PrintTimed(const Work& work) {
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  const double value = work();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  std::printf("%.17g %.9f %.9f\n", value, seconds.count(), static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
}

/// The next word, or the number that it is.
inline std::string Word(std::istringstream& words) {
  std::string word;
  words >> word;
  return word;
}
inline int Number(std::istringstream& words) { return std::stoi(Word(words)); }

}  // namespace mvstudio::bench
