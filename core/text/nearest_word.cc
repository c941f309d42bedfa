#include "core/text/nearest_word.h"

#include <algorithm>
#include <cctype>

namespace mvstudio {
namespace {

/// Number of letters to add, remove, change or exchange with a neighbour (optimal string alignment).
size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) {
    for (size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

std::string InSmallLetters(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

}  // namespace

std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates) {
  std::string nearest;
  const size_t letters = word.size() - std::min(word.size(), word.find_first_not_of('-'));
  size_t best = std::max<size_t>(1, letters / 4) + 1;  // farther words are other words: --session is no --version
  if (word.size() > 100) return "";
  const std::string lower = InSmallLetters(word);
  for (const std::string& candidate : candidates) {
    const size_t distance = EditDistance(lower, InSmallLetters(candidate));
    if (distance < best) best = distance, nearest = candidate;
  }
  return nearest;
}

}  // namespace mvstudio
