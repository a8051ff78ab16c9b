// Every manifold of the room lie/; one line each.
#pragma once

#include <lie/essential.hpp>
#include <lie/frame2.hpp>
#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/oriented_point.hpp>
#include <lie/product.hpp>
#include <lie/rn.hpp>
#include <lie/rxso2.hpp>
#include <lie/rxso3.hpp>
#include <lie/s2.hpp>
#include <lie/se2.hpp>
#include <lie/se23.hpp>
#include <lie/se3.hpp>
#include <lie/semi_oriented_frame3.hpp>
#include <lie/sim2.hpp>
#include <lie/sim3.hpp>
#include <lie/simple_manifold.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
