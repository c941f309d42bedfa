#pragma once

#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>
#include <vector>

/// Words that people type for a choice of a few.
namespace mvstudio {

/// Lower case letters, digits and what is neither, without spaces, hyphens and underscores: `OpenCV`, `open_cv` and `openCV`
/// are one word.
inline std::string PlainWord(std::string_view text) {
  std::string plain;
  for (const char c : text) {
    if (c != '_' && c != '-' && c != ' ') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

/// Number of letters to add, remove, change or exchange with a neighbour (optimal string alignment).
inline size_t EditDistance(const std::string& a, const std::string& b) {
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

/// The candidate that differs from `word` in fewer than a third of its letters; empty when there is none. Case and hyphens do
/// not count.
inline std::string NearestWord(std::string_view word, const std::vector<std::string>& candidates) {
  std::string nearest;
  if (word.size() > 100) return nearest;
  const std::string plain = PlainWord(word);
  size_t best = std::max<size_t>(1, plain.size() / 4) + 1;  // farther words are other words: session is no version
  for (const std::string& candidate : candidates) {
    const size_t distance = EditDistance(plain, PlainWord(candidate));
    if (distance < best) best = distance, nearest = candidate;
  }
  return nearest;
}

/// "; did you mean 'WORD'?", or nothing.
inline std::string DidYouMean(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string nearest = NearestWord(word, candidates);
  return nearest.empty() ? "" : "; did you mean '" + nearest + "'?";
}

}  // namespace mvstudio
