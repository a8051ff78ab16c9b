// A camera as the program's options give it; the models are tested in fusion/camera_test.cpp.

#include <cli/commands/camera.hpp>

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

TEST(Cameras, FromIntrinsics) {
  const Camera camera = cameraFromIntrinsics({450, 440, 376, 240});
  EXPECT_EQ(camera.fv, 440);
  EXPECT_EQ(camera.cu, 376);
  EXPECT_EQ(camera.distortion, Distortion::none);
  const auto message = [](const std::vector<double>& list) { return errorOf([&] { cameraFromIntrinsics(list); }); };
  EXPECT_EQ(message({450, 440, 376}),
            "--intrinsics: 450,440,376, expected fu,fv,cu,cv in pixels, the focal lengths positive");
  EXPECT_NE(message({450, -440, 376, 240}), "");
  EXPECT_NE(message({450, std::numeric_limits<double>::quiet_NaN(), 376, 240}), "");
}

}  // namespace
}  // namespace liestat::cli
