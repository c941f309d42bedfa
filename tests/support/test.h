#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

/// GoogleTest for tests/: what mvstudio::testing has, and the matchers that many tests use, go by their bare names in mvstudio.
namespace mvstudio {

namespace testing {}
using namespace testing;

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

}  // namespace mvstudio
