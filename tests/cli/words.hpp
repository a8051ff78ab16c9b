// Command lines of tests.
#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace liestat::cli {

using Words = std::vector<std::string>;

/// The words of a text between blanks.
inline Words wordsOf(const std::string& text) {
  std::istringstream stream(text);
  Words words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}
/// Words, and others after them.
inline Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace liestat::cli
